"""The retracing step: a run's readings once more, in the order of their time, leaving behind what a smoother needs.

In a package that `assembly` writes as it does for the compiled step, these files replace `run.py` and wrap `advance.py`
and `update.py`; everything else, and so every number of the state, is the compiled step's own.
`from fusiond.engine.step.NAME import` here becomes the wrapped file there, or the neighbour of that name.
"""
