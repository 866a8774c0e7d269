"""What screening and the step's own files ask of `update`."""

from __future__ import annotations

from fusiond.engine.step.update import innovate, load_noise

from .correct import correct

__all__ = ["correct", "innovate", "load_noise"]
