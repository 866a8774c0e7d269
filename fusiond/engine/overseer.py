"""Faults under a plain topology: the compiled engine of the same sensors hears every reading first and judges.

The monitors are kernels of the compiled step, and what they look at, the innovations of the filter of all sensors and
of those that leave one out, exists there alone: a topology with averaged gains or shared-out information has no
innovation whose distribution is known. So a compiled engine runs beside the plain one. What it decides about a sensor
(left out, corrected, weighed down) is written into the plain track and its snapshots, and the plain readings since the
onset are applied once more: the plain topology becomes what it would have been, had it known at the onset. Whose noise
stands still while an alarm is open (adaptation) is handed on as well.
A delay that cannot be spared is named but not taken off: that needs the rate of h, which only the monitors know.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from fusiond.engine.engine import Engine

PAST = ("excluded", "out_from_ns", "from_ns", "offset", "drift", "gain_error", "noise_excess")
"""Fields of a reaction that change what readings before it meant; of the others, `until_ns` concerns later ones."""


@dataclass(frozen=True, slots=True)
class Overseer:
    """Judges for a plain engine.

    Args:
        engine: the compiled engine of the same sensors, with its judge.
    """

    engine: Engine

    def reset(self) -> None:
        """Forget everything."""
        self.engine.reset()

    def _decided(self) -> NDArray[np.void]:
        """What has been decided; who is out is so from the onset on, for every filter here has heard it before."""
        decided = self.engine.track[0]["reaction"].copy()
        always = (decided["excluded"] != 0) & (decided["out_from_ns"] == 0)
        decided["out_from_ns"][always] = decided["onset_ns"][always]
        return np.asarray(decided)

    def _hand_on_frozen(self, plain: Engine) -> None:
        """Have the noise of those that may err otherwise stand still in the plain track too, and in its past."""
        if plain.layout.shape.adapt is None:
            return
        frozen = self.engine.track[0]["noise"]["frozen"]
        if not np.array_equal(frozen, plain.track[0]["noise"]["frozen"]):
            for records in plain.histories:
                records["noise"]["frozen"] = frozen

    def lead(self, plain: Engine, reading: NDArray[Any]) -> None:
        """Hear a reading (1,) before the plain engine does, and hand on what has been decided since."""
        self.engine.process(reading)
        self._hand_on_frozen(plain)
        decided, known = self._decided(), plain.track[0]["reaction"]
        if decided.tobytes() == known.tobytes():
            return
        changed = np.zeros(len(known["health"]), np.bool_)
        for field in PAST:
            differs = decided[field] != known[field]
            changed |= differs.reshape(len(changed), -1).any(axis=1)
        onsets = decided["onset_ns"][changed]
        for records in plain.histories:
            records["reaction"] = decided
        if (onsets > 0).any():
            plain.replay_since(int(onsets[onsets > 0].min()))
