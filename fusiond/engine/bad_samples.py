"""Bad samples: an alarm that a single reading of a sensor explains may be one, and the sensor's next reading tells.

A bad sample has been gated and changes no flag. An input's readings are not judged one by one: nothing predicts them.
"""

from __future__ import annotations

import numpy as np

from fusiond.engine.reactions import Reactions
from fusiond.faults.glr import Fit
from fusiond.types import Kind


def is_one_reading(reactions: Reactions, fit: Fit | None) -> bool:
    """Whether a single reading of the sensor, or one of each of a group's, says it all.

    Nor are one bad and one sound reading scatter.
    """
    if fit is None or fit.ground.is_input:
        return False
    since = reactions.window["sensor"][fit.onset :]
    return int(np.isin(since, fit.place).sum()) <= (2 if fit.kind is Kind.NOISE else 1) * len(fit.place)


def until_next(reactions: Reactions, fit: Fit | None) -> int:
    """Entries until the sensor's next reading is to be expected: as many as to its last one."""
    own = np.flatnonzero(np.isin(reactions.window["sensor"], fit.place if fit else ()))
    return int(own[-1] - own[-2]) if len(own) > 1 else 1


def is_bad_sample(reactions: Reactions, fit: Fit | None) -> bool:
    """Whether the reading that raised the alarm, or one before, was a spike, and its sensor is sound since."""
    if fit is None or fit.ground.is_input or fit.kind is not Kind.SPIKE:
        return False
    return reactions.onset_ns(fit.onset) <= int(reactions.engine.desk[0]["case_ns"])
