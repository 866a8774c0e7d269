"""The log, replay over an iterable of readings, import of foreign recordings, comparison of two runs."""
