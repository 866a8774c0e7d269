"""The compiled step.

This package is a template: `assembly` copies its files into a cache folder beside a configuration's own `process.py`,
`law.py`, `observe.py` and `sizes.py`, and compiles it there. As it stands it is complete: a scalar random walk with
one sensor.
"""
