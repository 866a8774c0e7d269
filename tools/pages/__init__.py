"""The pages under docs/ that are measured, not written: each program runs what it reports."""
