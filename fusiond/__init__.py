"""fusiond: one trustworthy state, the health of every sensor, and a safe command, from readings over Zenoh."""

import os

# Before numpy is loaded: threads cost matrices of this size more than they bring, and sum in an order of their own.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

__version__ = "0.1.0"
