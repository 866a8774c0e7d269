"""Sizes of the records as compile-time constants, so that loops unroll; `assembly` writes a configuration's own."""

STATES = 1
ERRORS = 1
INPUTS = 0
NOISES = 1
SENSORS = 1
FILTERS = 2
PAYLOAD = 1
CONTROLS = 0
FEEDS = 0
"""1 where the command drives the prediction."""
CELLS = 0
PROTECTED = 0
GUARDED = 0
WINDOW = 1
ADAPTS = 0
BINS = 0
"""Filters that share the ladder of levels of the only updating sensor's noise, rows 1 to BINS."""
STEADY = 0
"""Healthy silences for which a sensor must speak before it is silent no longer; 0 without fault detection."""
SNAPSHOT_EVERY = 8
"""Readings between two snapshots of the track; a rollback replays at most that many more than it must."""
