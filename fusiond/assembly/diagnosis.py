"""The diagnosability of a configuration, for `fusiond check`: what can be found, told apart, and what would help.

A cure is a sensor that the configuration does not have: one that reads a single state, once in the period of the
slowest sensor, as well as that state is known anyway. It cures a row where with it (itself sound) the fault can be told
from all it could not be told from, or lasts where the state would have learnt it.
"""

from __future__ import annotations

import math
from typing import Any

from fusiond.assembly.course import Witness, course_of, witness_of
from fusiond.assembly.detection import Detection
from fusiond.assembly.resolve import Resolved
from fusiond.faults.course import Signatures, Suspect, signatures
from fusiond.faults.diagnosability import TOLD_APART, Row, matrix, shares_left
from fusiond.faults.sizes import LONGEST, cumulative
from fusiond.types import Kind

CLEARLY = 2.0
"""A witness helps against finite information where it makes the smallest size found smaller by this factor."""


def name_of(resolved: Resolved, suspect: Suspect) -> str:
    """Key of the suspected channel, or input."""
    slots = resolved.process.inputs if suspect.is_input else resolved.sensors[suspect.sensor].model.channels
    return slots[suspect.channel].key


def _cured(row: Row, found: Signatures) -> bool:
    """Whether the signatures that a witness adds to free the row of what stands in its way."""
    i = found.suspects.index(row.suspect)
    if row.ambiguous:
        shares = shares_left(found, i)
        return all(shares[sensor] >= TOLD_APART for sensor in row.ambiguous)
    a = cumulative(found.curves[i][0], LONGEST)
    return bool(found.steady[i, i] > 0.0 and a[-1] >= CLEARLY**2 * row.total)


def cures(resolved: Resolved, detection: Detection, rows: list[Row]) -> dict[int, list[Witness]]:
    """Single witnesses that cure each bias row in need of one, by its place in `rows`."""
    needy = [
        place
        for place, row in enumerate(rows)
        if row.kind is Kind.BIAS and (row.ambiguous or row.steady <= 0.0)
    ]
    found: dict[int, list[Witness]] = {place: [] for place in needy}
    if not needy:
        return found
    for state in range(len(resolved.process.error_slots)):
        witness = witness_of(resolved, state)
        helped = signatures(course_of(resolved, witness), detection.signatures.suspects)
        for place in needy:
            if _cured(rows[place], helped):
                found[place].append(witness)
    return found


def _number(value: float) -> float | None:
    """A number JSON knows."""
    return value if math.isfinite(value) else None


def _line(resolved: Resolved, row: Row, helpers: list[Witness]) -> dict[str, Any]:
    """One row for people and JSON."""
    slots = resolved.process.error_slots
    return {
        "sensor": resolved.sensors[row.suspect.sensor].name,
        "channel": name_of(resolved, row.suspect),
        "kind": row.kind.label,
        "smallest": _number(row.smallest),
        "delay_s": _number(row.delays_s[0][1]) if row.delays_s else None,
        "delays_s": [[size, _number(wait_s)] for size, wait_s in row.delays_s],
        "information": {"first": row.first, "each": row.steady, "total": _number(row.total)},
        "told_apart": row.share,
        "ambiguous_with": [resolved.sensors[number].name for number in row.ambiguous],
        "reason": row.reason,
        "cured_by": [{"state": slots[one.state].key, "noise_std": one.noise_std} for one in helpers],
    }


def diagnosis_of(resolved: Resolved, detection: Detection) -> list[dict[str, Any]]:
    """Every row of the diagnosability matrix, ready for JSON."""
    rows = matrix(detection.course, detection.signatures, detection.promise, detection.tests)
    helpers = cures(resolved, detection, rows)
    return [_line(resolved, row, helpers.get(place, [])) for place, row in enumerate(rows)]
