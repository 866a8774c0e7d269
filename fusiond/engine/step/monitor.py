"""A configuration without fault detection: the hooks of the step, each doing nothing.

`assembly` copies `monitor_on.py` over this file where the configuration asks for detection.
"""

from __future__ import annotations

from typing import Any

from fusiond.numerics.kernel import kernel


@kernel
def carry(track: Any, work: Any, row: int, F: Any, B: Any) -> None:
    """One interval of the primary filter has passed."""


@kernel
def before_update(track: Any, design: Any, work: Any, reading: Any) -> None:
    """The primary filter is about to be corrected: work.nu, H, h, R_U are those of the reading, not yet whitened."""


@kernel
def after_update(track: Any, design: Any, work: Any, reading: Any, used: bool) -> None:
    """The primary filter has met a reading: work.e, root, H, K are those of its scalar channels."""


@kernel
def after_look(track: Any, design: Any, work: Any, reading: Any) -> None:
    """An excluded sensor's reading was compared with the estimate, without effect."""


@kernel
def is_excluded(track: Any, sensor: int, t_ns: int) -> bool:
    """Whether the sensor's readings of that time are not used."""
    return False


@kernel
def fall_back(track: Any, design: Any, t_ns: int) -> None:
    """Inputs that are silent or excluded are about to drive a prediction to t_ns."""


@kernel
def note_gate(track: Any, design: Any, row: int, sensor: int, nis: float) -> None:
    """Filter `row` has compared a reading of the sensor with itself."""


@kernel
def take_for_usual(track: Any, sensor: int, value: float) -> None:
    """What an input of one number is taken to be while it is out."""


@kernel
def note_input(track: Any, design: Any, work: Any, reading: Any) -> None:
    """An input is about to drive the prediction."""


@kernel
def note_value(track: Any, design: Any, reading: Any) -> None:
    """A reading that is not held came as this."""


@kernel
def corrected(track: Any, design: Any, reading: Any, spare: Any) -> Any:
    """The reading with the known error of its sensor taken off."""
    return reading


@kernel
def note_held(track: Any, design: Any, work: Any, reading: Any) -> None:
    """A sensor that holds its last value between fixes has sent it once more; work.h: what it should read."""


@kernel
def undelay(track: Any, design: Any, work: Any, reading: Any) -> None:
    """Add to work.nu what is known of the delay with which the reading was stamped."""


@kernel
def note_unusable(track: Any, desk: Any, reading: Any, usable: bool) -> None:
    """The door has let a reading in, or not."""


@kernel
def forget_all(track: Any, desk: Any) -> None:
    """The state starts anew."""


@kernel
def awaits_judgement(track: Any, desk: Any) -> bool:
    """Whether the caller must judge an alarm before the next reading."""
    return False
