"""fusiond: one trustworthy state, the health of every sensor, and a safe command, from readings over Zenoh."""

__version__ = "0.1.0"
