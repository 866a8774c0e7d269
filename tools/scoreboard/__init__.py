"""`make scoreboard`: how fast and how surely faults are found, over the limit."""
