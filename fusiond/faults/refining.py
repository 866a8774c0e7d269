"""Which kind, once the sensor is out or its error taken off: what all evidence since the onset says.

The hypotheses, their prices and the rule by which one is named are those of the first verdict (`glr`, `kinds`); the
onset is known by then, so that nothing is paid for it. A fault is called a bias as soon as one reading proves it, and
that it scales with what is read, or lags behind it, shows when the machine speeds up, slows down or turns.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.faults.glr import EXPECTED, FAINT, RARITY
from fusiond.faults.hearing import KINDS
from fusiond.faults.hypotheses import Hypothesis
from fusiond.faults.kinds import SHAPE
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Kind

CONTRADICTED = 6.9
"""Log likelihood against an error at which it is believed to have ended: one in a thousand that it has not."""


@dataclass(frozen=True, slots=True)
class Account:
    """One hypothesis, its onset known.

    Args:
        sizes: (q,) of its parts, as taken off a reading (a scale as a factor less one).   covariance: (q, q).
        score: log likelihood over no fault, less what was fitted.
    """

    hypothesis: Hypothesis
    sizes: Vector
    covariance: Matrix
    score: float

    @property
    def kind(self) -> Kind:
        """Kind of the fault."""
        return self.hypothesis.kind

    @property
    def largest(self) -> int:
        """The part that stands out most from its uncertainty."""
        return int(np.argmax(np.abs(self.sizes) / np.sqrt(np.maximum(np.diagonal(self.covariance), 1e-300))))

    @property
    def std(self) -> float:
        """Standard deviation of that part's size."""
        return float(np.sqrt(self.covariance[self.largest, self.largest]))


def account(evidence: NDArray[Any], hypothesis: Hypothesis, taken: Vector | None = None) -> Account | None:
    """What the evidence says for one lasting error of its sensor; None where it says nothing of it.

    Args:
        evidence: (1,) of `hearing.evidence_dtype`.
        taken: (columns,) what has been taken off the readings heard.
    """
    V = _parts(hypothesis, len(evidence[0]["power"]))
    everything, matched = evidence[0]["information"], evidence[0]["matched"]
    if taken is not None:
        matched = matched + everything @ taken
    a, b = V.T @ everything @ V, V.T @ matched
    if not np.all(np.diagonal(a) > 0.0):
        return None
    covariance: Matrix = np.linalg.pinv(a, rcond=FAINT, hermitian=True)
    sizes = covariance @ b
    readings = max(int(evidence[0]["readings"]), 1)
    per_deviation = np.sqrt(readings / np.maximum(V.T @ evidence[0]["power"], 1e-300))
    informed = per_deviation[:, np.newaxis] * a * per_deviation
    paid = 0.5 * float(np.linalg.slogdet(np.eye(len(a)) + EXPECTED**2 * informed)[1])
    return Account(
        hypothesis, sizes, covariance, 0.5 * float(b @ sizes) - paid - RARITY.get(hypothesis.kind, 0.0)
    )


def _parts(hypothesis: Hypothesis, columns: int) -> Matrix:
    """(columns, q) which columns each part errs through."""
    m = columns // len(KINDS)
    V: Matrix = np.zeros((columns, len(hypothesis.parts)))
    for part, suspects in enumerate(hypothesis.parts):
        for suspect in suspects:
            V[KINDS.index(hypothesis.kind) * m + suspect.channel, part] = 1.0
    return V


def accounts(
    evidence: NDArray[Any], hypotheses: Iterable[Hypothesis], sensor: int, taken: Vector | None = None
) -> list[Account]:
    """Every lasting error of the sensor, the best first."""
    own = [one for one in hypotheses if one.place == (sensor,) and one.kind in KINDS and not _is_input(one)]
    found = [account(evidence, one, taken) for one in own]
    age_s = (int(evidence[0]["heard_ns"]) - int(evidence[0]["from_ns"])) * 1e-9
    return sorted(
        (
            one
            for one in found
            if one is not None and not (one.kind is Kind.DELAY and abs(float(one.sizes[0])) > age_s)
        ),
        key=lambda one: -one.score,
    )


def _is_input(hypothesis: Hypothesis) -> bool:
    return any(suspect.is_input for part in hypothesis.parts for suspect in part)


def best_of_kinds(found: Sequence[Account]) -> list[Account]:
    """The best of each kind, best first.

    Args:
        found: of `accounts`.
    """
    best: dict[Kind, Account] = {}
    for one in found:
        best.setdefault(one.kind, one)
    return list(best.values())


def settle_kind(found: Sequence[Account], known: Kind) -> Account | None:
    """The error to name; None where there is no error.

    Args:
        found: of `accounts`.   known: the kind named so far, which stays until another explains more by `SHAPE`.
    """
    best = best_of_kinds(found)
    if not best or best[0].score <= 0.0:
        return None
    named = next((one for one in best if one.kind is known), best[0])
    return best[0] if best[0].score - named.score > SHAPE else named


def ended(one: Account, lately: Sequence[NDArray[Any]]) -> bool:
    """Whether the readings of late, in one stretch or another, contradict an error.

    Where they show too little to contradict it nothing ever might, as the estimate is too unsure: such a sensor is not
    kept out for ever. But where it is the motion that does not show a scale or a delay one waits for motion.

    Args:
        lately: (1,) of `evidence_dtype` each, of several stretches, the longest first.
    """
    error = _parts(one.hypothesis, len(lately[0][0]["power"])) @ one.sizes
    longest = lately[0][0]
    shows = 0.5 * float(error @ longest["information"] @ error)
    stands_out = 0.5 * float(error**2 @ longest["power"])
    if shows < CONTRADICTED and (stands_out >= CONTRADICTED or one.kind in (Kind.BIAS, Kind.DRIFT)):
        return True
    return any(
        float(error @ part[0]["matched"] - 0.5 * error @ part[0]["information"] @ error) <= -CONTRADICTED
        for part in lately
    )


def sizes_of(one: Account) -> dict[int, float]:
    """Its sizes, by raw channel."""
    return {
        suspect.channel: float(size)
        for size, part in zip(one.sizes, one.hypothesis.parts, strict=True)
        for suspect in part
    }
