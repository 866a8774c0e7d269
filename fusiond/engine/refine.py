"""The kind of a fault is kept open while it lasts: evidence is gathered on, and the verdict follows it.

From the onset on every reading of a sensor that is out, or used with its error taken off, is heard (`faults.hearing`),
up to the horizon: what is older no late reading can change. When that has grown by a share, all lasting kinds are
weighed again; the kind, its size and deviation are written anew. A sensor whose error is taken off has another one
taken off where the kind has changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.correction import LASTING, Attempt, replace_correction, taken_off
from fusiond.engine.reactions import Reactions
from fusiond.faults.hearing import begin, hear
from fusiond.faults.hypotheses import Hypothesis, Place
from fusiond.faults.kinds import FAMILY, SHAPE
from fusiond.faults.refining import Account, accounts, best_of_kinds, ended, settle_kind, sizes_of
from fusiond.numerics.ud import Vector
from fusiond.types import NANOSECONDS, Health, Kind, Role

if TYPE_CHECKING:
    from fusiond.engine.engine import Engine

GROWN = 0.25
"""Evidence is weighed again when its time has grown by this share,"""
SHORTEST_NS, MOST_OF_WINDOW = NANOSECONDS // 2, 0.25
"""but not before this, nor later than in this share of the window's time, beyond which entries would be lost."""
STRETCHES = (2, 4, 8, 16)
"""Shares of the window that are asked whether a fault has ended."""
POSSIBLE = 2.0 * FAMILY
"""A kind that explains the evidence less well by this, in log likelihood, is none that the fault may have."""
SURE = 2.0
"""Standard deviations of its onset after which a fault has surely begun."""
WATCHED = (Health.EXCLUDED, Health.PROBATION, Health.FAULTY)


def watch(reactions: Reactions, sensor: int, place: Place, onset_std_s: float) -> None:
    """Begin to gather evidence about a sensor whose lasting error has just been named; none where a group shares it.

    Readings from before the onset would speak against every error. So those of a sensor that is out count from when it
    has surely begun; of one that is used each has moved the estimate.
    """
    reaction, updates = reactions.reaction, reactions.layout.sensors[sensor].role is Role.UPDATE
    begin(_evidence(reactions, sensor), 0, 0)
    if not updates or len(place) > 1 or reaction["kind"][sensor] not in LASTING:
        return
    onset_ns, out = int(reaction["onset_ns"][sensor]), reaction["health"][sensor] == Health.EXCLUDED
    if out:
        surely_ns = min(onset_ns + int(SURE * onset_std_s * NANOSECONDS), reactions.now_ns)
    else:
        onset_ns = surely_ns = int(reaction["from_ns"][sensor, 1])
    begin(_evidence(reactions, sensor), onset_ns, surely_ns)
    plan(reactions, reactions.now_ns + SHORTEST_NS)


def plan(reactions: Reactions, due_ns: int) -> None:
    """Look again at that time, if not before."""
    desk = reactions.engine.desk[0]
    planned = int(desk["refine_ns"])
    desk["refine_ns"] = min(planned, due_ns) if planned else due_ns


def _evidence(reactions: Reactions, sensor: int) -> NDArray[Any]:
    """(1,) what has been heard of a sensor."""
    return np.asarray(reactions.engine.desk[0]["evidence"][sensor : sensor + 1])


def is_watched(reactions: Reactions, sensor: int) -> bool:
    """Whether the kind of the sensor's fault is kept open."""
    reaction, began = reactions.reaction, reactions.engine.desk[0]["evidence"]["from_ns"]
    lasting = reaction["kind"][sensor] in LASTING and reaction["health"][sensor] in WATCHED
    return bool(began[sensor] and lasting)


def refine(reactions: Reactions, hypotheses: Sequence[Hypothesis]) -> None:
    """Hear what has come since, and say of every sensor watched what it is most likely to have."""
    engine = reactions.engine
    sensors = [one.number for one in reactions.layout.sensors if is_watched(reactions, one.number)]
    if not sensors:
        return
    for sensor in sensors:
        refine_one(reactions, sensor, hypotheses)
    plan(reactions, reactions.now_ns + _wait_ns(engine, sensors))
    reactions.replay()


def refine_one(reactions: Reactions, sensor: int, hypotheses: Sequence[Hypothesis]) -> bool:
    """Hear one sensor and say what it has; whether that is another kind than before."""
    evidence, health = _evidence(reactions, sensor), reactions.reaction["health"][sensor]
    window = reactions.engine.window
    hear(
        evidence, window, sensor, reactions.noise_std[sensor], reactions.now_ns - reactions.engine.horizon_ns
    )
    taken = taken_off(reactions, sensor) if health == Health.FAULTY else None
    known = Kind(int(reactions.reaction["kind"][sensor]))
    one = settle_kind(accounts(evidence, hypotheses, sensor, taken), known)
    if one is None or one.score < evidence[0]["score"] - SHAPE:
        return False  # it explains less than it did: the fault may have ended, and what came since says nothing of it
    evidence["score"] = max(one.score, float(evidence[0]["score"]))
    another = one.kind is not known
    if taken is not None:
        # its predictions hold what it said before: a scale or delay that outdid a bias in the window is left as it is
        another = another and known in (Kind.BIAS, Kind.DRIFT) and _take_off_instead(reactions, sensor, one)
        if another:
            evidence["matched"] += evidence[0]["information"] @ (taken - taken_off(reactions, sensor))
    elif (health == Health.EXCLUDED or another) and not ended(
        one, _stretches(evidence, window, sensor, reactions.noise_std[sensor])
    ):
        # a sensor whose bias is gone was not biased, if it errs on in another way
        reactions.write("health", Health.EXCLUDED, sensor)
        _say(reactions, sensor, one)
        reactions.expect(sensor, one.kind, sizes_of(one))
    return another


def _take_off_instead(reactions: Reactions, sensor: int, one: Account) -> bool:
    """Take another error off a sensor in use, on trial; whether that made the innovations smaller, or was undone."""
    attempt = Attempt(reactions.engine, (sensor,), int(reactions.reaction["from_ns"][sensor, 1]))
    _say(reactions, sensor, one)
    replace_correction(reactions, sensor, one.kind, sizes_of(one))
    reactions.replay()
    if attempt.helped:
        return True
    attempt.withdraw()
    return False


def _wait_ns(engine: Engine, sensors: list[int]) -> int:
    """Time until the evidence of the youngest fault has grown by its share."""
    evidence, window = engine.desk[0]["evidence"], engine.window
    age_ns = min(int(evidence["heard_ns"][k] - evidence["from_ns"][k]) for k in sensors)
    longest_ns = (
        int(MOST_OF_WINDOW * (window["t_ns"][-1] - window["t_ns"][0])) if len(window) else SHORTEST_NS
    )
    return max(SHORTEST_NS, min(int(GROWN * age_ns), longest_ns))


def _say(reactions: Reactions, sensor: int, one: Account) -> None:
    """Write the kind and its size anew."""
    part = one.largest
    channels = [suspect.channel for suspect in one.hypothesis.parts[part]]
    said = {
        "kind": one.kind, "channel": channels[0] if len(channels) == 1 else -1,
        "size": float(one.sizes[part]) + (1.0 if one.kind is Kind.SCALE else 0.0), "size_std": one.std,
    }  # fmt: skip
    for field, value in said.items():
        reactions.write(field, value, sensor)


def goes_on(reactions: Reactions, sensor: int, hypotheses: Sequence[Hypothesis]) -> bool:
    """Whether the fault of a sensor that is out may be there still, though its readings agree with the estimate.

    Every kind must be contradicted that, had it gone on till now, would explain nearly as much as the best one did when
    it explained most.
    """
    if not is_watched(reactions, sensor):
        return False
    evidence, window = _evidence(reactions, sensor).copy(), reactions.engine.window
    hear(evidence, window, sensor, reactions.noise_std[sensor], reactions.now_ns)
    least = max(float(evidence[0]["score"]) - POSSIBLE, 0.0)
    possible = best_of_kinds([one for one in accounts(evidence, hypotheses, sensor) if one.score > least])
    stretches = _stretches(evidence, window, sensor, reactions.noise_std[sensor])
    return any(not ended(one, stretches) for one in possible)


def lead_of_another(reactions: Reactions, hypotheses: Sequence[Hypothesis], sensor: int) -> float:
    """Log likelihood by which an error of another kind explains all evidence better than the one that is taken off.

    Minus infinity where the kind is not kept open, or no other is possible.
    """
    if not is_watched(reactions, sensor):
        return -np.inf
    evidence, taken = _evidence(reactions, sensor).copy(), taken_off(reactions, sensor)
    hear(evidence, reactions.engine.window, sensor, reactions.noise_std[sensor], reactions.now_ns)
    known = reactions.reaction["kind"][sensor]
    others = [one.score for one in accounts(evidence, hypotheses, sensor, taken) if one.kind != known]
    ear = evidence[0]
    so_far = float(taken @ ear["matched"] + 0.5 * taken @ ear["information"] @ taken)
    return max(others, default=-np.inf) - so_far


def _stretches(
    evidence: NDArray[Any], window: NDArray[Any], sensor: int, noise_std: Vector
) -> list[NDArray[Any]]:
    """(1,) each, what the last parts of the window say of the same fault, the longest first."""
    found, onset_ns = [], int(evidence[0]["from_ns"])
    for share in STRETCHES:
        late = window[-(len(window) // share) :]
        recent = np.zeros_like(evidence)
        begin(recent, onset_ns, max(onset_ns, int(late["t_ns"][0])))
        hear(recent, late, sensor, noise_std, int(late["t_ns"][-1]))
        found.append(recent)
    return found
