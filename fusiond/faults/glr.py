"""Generalised likelihood ratio of every hypothesis and every onset in a window.

With w(o) the whitened means that a unit fault from onset o on would give the innovations e (all N(0, 1) without it),

    a = w'w,   b = w'e,   size = b / a,   variance of the size = 1 / a,   GLR = b^2 / (2 a),

and the same with matrices where a fault has several sizes (GLR = b' a^-1 b / 2). To compare explanations of different
make, each pays for what was fitted: for the size what a width of EXPECTED noise deviations, expected beforehand, loses
against the width left by the window; ln(number of onsets tried) for the onset, as if every reading were as likely a
beginning; and RARITY for its kind.

Source: Willsky & Jones 1976. Laws: tests/laws/test_glr.py.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from fusiond.faults.ground import Ground, basis, ground_of, information, oddity, profile_of
from fusiond.faults.hypotheses import Hypothesis, Place
from fusiond.faults.response import Response
from fusiond.faults.spread import fit_spread
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Kind

EXPECTED = 10.0
"""Beforehand, errors of readings are of this many standard deviations of their noise (one standard deviation)."""
FACTOR = 1.5
"""Beforehand, the logarithm of a change of noise has this standard deviation."""
RARITY = {Kind.DRIFT: 1.0, Kind.SCALE: 3.0, Kind.DELAY: 3.0}
"""Log odds of a bias, beforehand, over other kinds: the more shapes are tried, the more of them noise resembles."""
FAINT = 1e-9
"""Share of a hypothesis's largest information below which an onset says nothing."""


@dataclass(frozen=True, slots=True)
class Fit:
    """One hypothesis at its most likely onset.

    Args:
        onset: entry of the window at which it begins.   size: (q,).   covariance: (q, q).
        glr: log likelihood ratio against no fault.   score: the same after what was fitted is paid for.
        removed: what it explains of the sum of squares of e.
        ground: where it acts.   number: of the onset among the ground's entries.
        curve: (o,) log likelihood ratio of each onset tried.   information: (o,) determinant of a; of a
            change of noise, of its factor's logarithm: two a reading.
    """

    hypothesis: Hypothesis
    onset: int
    size: Vector
    covariance: Matrix
    glr: float
    score: float
    removed: float
    ground: Ground = field(repr=False)
    number: int
    curve: Vector = field(repr=False)
    information: Vector = field(repr=False)

    @property
    def place(self) -> Place:
        """Sensors the fault sits in."""
        return self.hypothesis.place

    @property
    def kind(self) -> Kind:
        """Kind of the fault."""
        return self.hypothesis.kind

    @property
    def evidence(self) -> float:
        """The score with the onset left open: the log of the likelihood of all onsets tried, not of the best alone.

        The best one holds the share w of their probability, so all of them together hold 1 / w as much.
        """
        weight = onset_weights(self.curve, self.information)
        return self.score - math.log(max(float(weight[self.number]), 1e-300))

    def basis(self) -> Matrix:
        """(E, q) whitened means for a unit of each size; a change of noise has none."""
        if self.kind is Kind.NOISE:
            return np.zeros((len(self.ground.response.e), 0))
        return basis(self.ground, self.hypothesis, self.number)


def onset_weights(curve: Vector, information: Vector) -> Vector:
    """(o,) probability of each onset from its log likelihood ratio and the determinant of its information."""
    known = information > FAINT * np.max(information, initial=0.0)
    logs = np.where(known, curve - 0.5 * np.log(np.where(known, information, 1.0)), -np.inf)
    if not np.any(known):
        logs = curve
    weight = np.exp(logs - np.max(logs))
    return weight / np.sum(weight)


def likelihoods(a: Matrix, b: Matrix) -> tuple[Vector, Vector]:
    """Size and GLR for every onset from a (o, q, q) and b (o, q); zero where a says nothing.

    Returns:
        sizes (o, q), GLR (o,).
    """
    if a.shape[1] == 1:
        scalar = a[:, 0, 0]
        faint = scalar <= FAINT * np.max(scalar, initial=1e-300)
        sizes = np.where(faint[:, None], 0.0, b / np.where(faint, 1.0, scalar)[:, None])
    else:
        sizes = np.einsum("oqr,or->oq", np.linalg.pinv(a, rcond=FAINT, hermitian=True), b)
    return sizes, 0.5 * np.einsum("oq,oq->o", b, sizes)


def unforeseen(informed: float) -> float:
    """Log likelihood a fitted number costs: Occam's factor of a normal prior (Bayes; GLR alone forgets it).

    Args:
        informed: information the window holds of the number, in units where EXPECTED noise deviations are 10.
    """
    return 0.5 * float(np.log1p(EXPECTED**2 * informed))


def price(ground: Ground, hypothesis: Hypothesis, number: int, a: Matrix) -> float:
    """What the sizes (information a (q, q)) of a fault from the ground's entry `number` on cost."""
    if ground.is_input:
        return unforeseen(1.0) * len(a)
    profile = profile_of(ground, hypothesis, number)
    ratio = profile**2 / ground.variance[:, None]
    count = np.maximum(np.count_nonzero(ratio, axis=0), 1)
    per_deviation = np.sqrt(count / np.maximum(np.sum(ratio, axis=0), 1e-300))
    informed = per_deviation[:, None] * a * per_deviation
    return 0.5 * float(np.linalg.slogdet(np.eye(len(a)) + EXPECTED**2 * informed)[1])


def fit_signature(ground: Ground, hypothesis: Hypothesis) -> Fit:
    """The most likely onset and size of a fault with a signature."""
    a, b = information(ground, hypothesis)
    sizes, glr = likelihoods(a, b)
    if hypothesis.kind is Kind.DELAY:
        # no reading can be later than its fault is old: beyond, the rate of change says nothing
        age_s = ground.response.t_s[-1] - ground.response.t_s[ground.entries]
        glr = np.where(np.abs(sizes[:, 0]) <= age_s, glr, 0.0)
    best = int(np.argmax(glr))
    paid = (
        price(ground, hypothesis, best, a[best]) + float(np.log(len(glr))) + RARITY.get(hypothesis.kind, 0.0)
    )
    paid -= oddity(ground, hypothesis, best)
    return Fit(
        hypothesis, int(ground.entries[best]), sizes[best], np.linalg.pinv(a[best], rcond=FAINT, hermitian=True),
        float(glr[best]), float(glr[best]) - paid, 2.0 * float(glr[best]),
        ground, best, glr, np.linalg.det(a),
    )  # fmt: skip


def fit_noise(ground: Ground, hypothesis: Hypothesis) -> Fit:
    """The most likely onset and factor of a change of noise."""
    spread = fit_spread(ground)
    paid = 0.5 * float(
        np.log1p(FACTOR**2 * spread.factor**2 / spread.factor_var) + 2.0 * np.log(len(spread.curve))
    )
    return Fit(
        hypothesis, spread.onset, np.array([spread.factor]), np.array([[spread.factor_var]]), spread.glr,
        spread.glr - paid, spread.removed,
        ground, int(np.searchsorted(ground.entries, spread.onset)), spread.curve,
        2.0 * np.arange(len(spread.curve), 0.0, -1.0),
    )  # fmt: skip


def scan(response: Response, hypotheses: Iterable[Hypothesis]) -> list[Fit]:
    """Every hypothesis at its most likely onset, the best score first; those without a reading are left out."""
    grounds: dict[tuple[Place, tuple[int, ...]], Ground] = {}
    fits: list[Fit] = []
    for hypothesis in hypotheses:
        suspects = [suspect for part in hypothesis.parts for suspect in part]
        driven = tuple(sorted({suspect.channel for suspect in suspects if suspect.is_input}))
        where = (hypothesis.place, driven)
        if where not in grounds:
            grounds[where] = ground_of(response, *where)
        if len(grounds[where].entries):
            fit = fit_noise if hypothesis.kind is Kind.NOISE else fit_signature
            fits.append(fit(grounds[where], hypothesis))
    return sorted(fits, key=lambda fit: -fit.score)
