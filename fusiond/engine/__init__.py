"""The track record, the step and the history: the only place where fusion, faults, adapt and control meet."""
