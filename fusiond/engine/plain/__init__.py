"""The plain step: the seeds' recursions and every fusion topology, in numpy, behind the compiled step's own contract.

These files replace, in a package that `assembly` writes as it does for the compiled step, those of
`fusiond.engine.step` that touch a covariance; screening, order, late readings, clocks, held inputs, health and control
are the compiled step's own files with the compiler taken away. `from fusiond.engine.step.NAME import` here becomes
the neighbour of that name there.
"""
