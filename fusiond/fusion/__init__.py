"""How several sensors become one state."""
