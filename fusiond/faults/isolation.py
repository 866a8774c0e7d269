"""Isolation: who is wrong? One sensor, a group with a common fault, a set that cannot be told apart, or the model.

Each place (a sensor, or a group) pleads with its best explanation. The best place is named when it beats every other by
the margin. Where it does not, the question is whether waiting can help, and that is computed, not guessed: both
explanations are carried on into the readings the window can still hold (half a window at least). If even they would
not part the two, the answer is the ambiguous set; else: ask again later. Where the two look the same in the long run
and only the
first moments after the onset tell them apart, much more is demanded, as that evidence stands and falls with the
assumption of a sudden onset. Of two sensors that the diagnosability matrix calls ambiguous it counts for nothing: what
is promised there is the set, however large the jump.

An explanation must also explain: if what it leaves over is more than noise, faults of any shape in one sensor, then two
faults at once, and at last the model are tried.

Source: Willsky & Jones 1976; Nikiforov 1995 for the margin; theory: Schur complements of the information, so that a
sensor is told from another exactly as well as its fault is seen without the other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from fusiond.faults.disturbance import model_score
from fusiond.faults.forecast import Separation, separate
from fusiond.faults.glr import Fit, scan
from fusiond.faults.ground import free
from fusiond.faults.hypotheses import Hypothesis, Place
from fusiond.faults.kinds import Choice, choose_kind
from fusiond.faults.response import Response
from fusiond.types import Kind


@dataclass(frozen=True, slots=True)
class Twins:
    """Pairs of sensors that nothing lasting tells apart.

    Args:
        pairs: that the diagnosability matrix calls ambiguous.   covered: sensors weighed down as one of such a pair;
            the filter's gains are then not those of the matrix, and no evidence counts between the two.
    """

    pairs: frozenset[frozenset[int]] = frozenset()
    covered: frozenset[int] = frozenset()

    def are(self, one: Place, other: Place) -> bool:
        """Whether two places are such a pair."""
        return frozenset((*one, *other)) in self.pairs

    def closed(self, one: Place, other: Place) -> bool:
        """Whether nothing may tell them apart now."""
        return self.are(one, other) and bool({*one, *other} & self.covered)


class Outcome(IntEnum):
    """What isolation found."""

    NOTHING = 0
    """nothing explains the window better than no fault does"""
    UNDECIDED = 1
    """more readings will tell"""
    ONE = 2
    GROUP = 3
    """several sensors share one fault of one size"""
    AMBIGUOUS = 4
    """no reading to come tells these places apart"""
    MODEL = 5


@dataclass(frozen=True, slots=True)
class Margins:
    """How sure isolation must be, in log likelihood.

    Args:
        place: of the named place over every other.   sudden: the same where only the first moments after the onset
            tell the two apart.   alike: squared sine of two signatures' angle below which they will look the same.
        misfit: standard deviations by which what is left over may exceed noise.
    """

    place: float = math.log(100.0)
    sudden: float = math.log(1e6)
    alike: float = 0.02
    misfit: float = 4.5


@dataclass(frozen=True, slots=True)
class Finding:
    """What isolation found.

    Args:
        sensors: the one named, the group, or all that may be it.   fit: best explanation at the best place.
        choice: which kind, and which kinds it may also be.   margin: log likelihood over the best other place.
        confidence: probability of the named place (or set), all having been equally likely before.
        fits: explains all but noise.   also: a second fault at the same time.
        standing: the best explanation at each place that may be it.
    """

    outcome: Outcome
    sensors: Place
    fit: Fit | None
    choice: Choice
    margin: float
    confidence: float
    fits: bool = True
    also: Fit | None = None
    standing: tuple[Fit, ...] = ()


def isolate(
    response: Response,
    hypotheses: Sequence[Hypothesis],
    margins: Margins | None = None,
    restless: frozenset[int] | None = None,
    twins: Twins | None = None,
) -> Finding:
    """Weigh every hypothesis over the window.

    Args:
        response: of the window.   hypotheses: of `catalogue`.   margins: defaults where None.
        restless: sensors whose noise may have become less, as it is taken for more than declared; any, where None.
        twins: none where None.
    """
    margins, twins = margins or Margins(), twins or Twins()
    fits = [fit for fit in scan(response, hypotheses) if restless is None or not _calm(fit, restless)]
    nothing = Finding(Outcome.NOTHING, (), None, Choice(Kind.NONE), 0.0, 0.0)
    if not fits or fits[0].score <= 0.0:
        return nothing
    best = fits[0]
    places = _best_of_places(fits)
    model = model_score(response) if len(np.unique(response.sensor)) > 1 else -math.inf
    if model - best.score >= margins.place:
        convicted = replace(nothing, outcome=Outcome.MODEL, fit=best, margin=model - best.score)
        two = _two(response, hypotheses, fits, model + margins.place, margins)
        return _with_twins(two, places, twins) if two else convicted
    surplus = _surplus(response, best.onset, best.removed, len(best.size))
    if surplus > margins.misfit:
        return _with_twins(_unexplained(response, hypotheses, fits, margins), places, twins)
    return _decide(fits, places, model, margins, twins)


def _with_twins(found: Finding, places: Sequence[Fit], twins: Twins) -> Finding:
    """The set of the sensor found and its twins, where a sensor was found by how its fault began."""
    if found.outcome is not Outcome.ONE or found.choice.kind in (Kind.NOISE, Kind.SPIKE):
        return found
    alike = tuple(fit for fit in places if twins.are(found.sensors, fit.place))
    if not alike or found.fit is None:
        return found
    standing = (found.fit, *alike)
    sensors = tuple(sorted({k for fit in standing for k in fit.place}))
    return replace(found, outcome=Outcome.AMBIGUOUS, sensors=sensors, standing=standing)


def _calm(fit: Fit, restless: frozenset[int]) -> bool:
    """Whether it says no more than that a declared noise is cautious: that is no fault, and explains none."""
    return fit.kind is Kind.NOISE and float(fit.size[0]) <= 1.0 and not set(fit.place) <= restless


def _best_of_places(fits: Sequence[Fit]) -> list[Fit]:
    """The best explanation of each place, best first."""
    found: dict[Place, Fit] = {}
    for fit in fits:
        found.setdefault(fit.place, fit)
    return list(found.values())


def _best_of_kinds(fits: Sequence[Fit]) -> list[Fit]:
    """The best explanation of each kind, best first."""
    found: dict[Kind, Fit] = {}
    for fit in fits:
        found.setdefault(fit.kind, fit)
    return list(found.values())


def _share(named: Sequence[float], places: Sequence[Fit]) -> float:
    """Probability of the named scores among all places and no fault at all."""
    scores = np.array([*(fit.score for fit in places), 0.0])
    top = max(float(np.max(scores)), *named)
    weight = math.fsum(math.exp(score - top) for score in named)
    return weight / (
        math.fsum(np.exp(scores - top)) + sum(math.exp(s - top) for s in named if s not in scores)
    )


def _surplus(response: Response, onset: int, removed: float, fitted: int) -> float:
    """Standard deviations by which the squares left over since the onset exceed those of noise (Wilson & Hilferty)."""
    since = response.entry >= onset
    n = int(np.sum(since)) - fitted
    if n <= 0:
        return 0.0
    left = max(float(np.sum(response.e[since] ** 2)) - removed, 0.0)
    return ((left / n) ** (1.0 / 3.0) - (1.0 - 2.0 / (9.0 * n))) / math.sqrt(2.0 / (9.0 * n))


def _demands(best: Fit, pleas: Sequence[Fit], margins: Margins, twins: Twins) -> list[tuple[bool, bool]]:
    """Whether the margin of `best` over each plea falls short of what is needed, and whether waiting can bring it."""
    half = len(best.ground.response) // 2
    lasting = [plea for plea in pleas if Kind.NOISE not in (best.kind, plea.kind)]
    apart = iter(separate(best, lasting, [max(best.onset, plea.onset, half) for plea in lasting]))
    demands = []
    for plea in pleas:
        which = next(apart) if Kind.NOISE not in (best.kind, plea.kind) else None
        needs = margins
        if best.kind is not Kind.SPIKE and twins.closed(best.place, plea.place):
            needs = replace(margins, place=math.inf, sudden=math.inf)
        twin = best.kind is not Kind.SPIKE and twins.are(best.place, plea.place)
        demands.append(_demand(best.score - plea.score, which, needs, twin=twin))
    return demands


def _demand(margin: float, apart: Separation | None, margins: Margins, *, twin: bool) -> tuple[bool, bool]:
    """Whether a margin falls short of what is needed, and whether waiting can bring it."""
    if apart is None:
        return margin < margins.place, True
    lasts, alike = apart.strength >= 1.0, apart.sine2 < margins.alike
    needed = margins.sudden if lasts and alike else margins.place
    if twin and (alike or not lasts):
        needed = math.inf
    return margin < needed, margin + apart.gain + 2.0 * math.sqrt(2.0 * apart.gain) >= needed


def _decide(
    fits: Sequence[Fit], places: Sequence[Fit], model: float, margins: Margins, twins: Twins
) -> Finding:
    """Name the best place, the set, or nobody yet."""
    best = places[0]
    choice = choose_kind([fit for fit in fits if fit.place == best.place])
    rivals = places[1:]
    margin = min([best.score - rival.score for rival in rivals] + [best.score, best.score - model])
    # a model that scatters more than it should looks much like one noisy sensor
    standing, hope = [best], best.score - model < (margins.place if best.kind is Kind.NOISE else 0.0)
    close = [
        fit
        for fit in fits
        if fit.place != best.place
        and (best.score - fit.score < margins.sudden or twins.are(best.place, fit.place))
    ]
    pleas = [
        plea for rival in rivals for plea in _best_of_kinds([f for f in close if f.place == rival.place])
    ]
    demanded = list(zip(pleas, _demands(best, pleas, margins, twins), strict=True))
    for rival in rivals:
        demands = [demand for plea, demand in demanded if plea.place == rival.place]
        if any(short for short, _ in demands):
            standing.append(rival)
            hope = hope or all(can_part for short, can_part in demands if short)
    sensors = tuple(sorted({sensor for fit in standing for sensor in fit.place}))
    confidence = _share([fit.score for fit in standing], places)
    outcome = Outcome.ONE if len(best.place) == 1 else Outcome.GROUP
    if len(standing) > 1:
        outcome = Outcome.UNDECIDED if hope or choice.kind is Kind.NONE else Outcome.AMBIGUOUS
    elif hope or choice.kind is Kind.NONE:
        outcome = Outcome.UNDECIDED
    return Finding(outcome, sensors, best, choice, margin, confidence, standing=tuple(standing))


def _unexplained(
    response: Response, hypotheses: Sequence[Hypothesis], fits: Sequence[Fit], margins: Margins
) -> Finding:
    """No single explanation suffices: a fault of any shape in one sensor, two faults, or the model."""
    places = _best_of_places(fits)
    onset = min(fit.onset for fit in places if fit.score > 0.5 * places[0].score)
    alone = [fit for fit in places if _surplus(response, onset, *free(fit.ground, onset)) <= margins.misfit]
    if alone:
        outcome = (
            (Outcome.ONE if len(alone[0].place) == 1 else Outcome.GROUP)
            if len(alone) == 1
            else Outcome.UNDECIDED
        )
        sensors = tuple(sorted({sensor for fit in alone for sensor in fit.place}))
        choice = choose_kind([fit for fit in fits if fit.place == alone[0].place])
        ahead = alone[0].score - max((fit.score for fit in places if fit is not alone[0]), default=0.0)
        return Finding(
            outcome, sensors, alone[0], choice, ahead, _share([alone[0].score], places),
            fits=False, standing=tuple(alone),
        )  # fmt: skip
    two = _two(response, hypotheses, fits, -math.inf, margins)
    if two is not None:
        return two
    sensors = tuple(sorted({sensor for fit in places for sensor in fit.place}))
    return Finding(Outcome.MODEL, sensors, places[0], Choice(Kind.NONE), 0.0, 0.0, fits=False)


def _two(
    response: Response, hypotheses: Sequence[Hypothesis], fits: Sequence[Fit], least: float, margins: Margins
) -> Finding | None:
    """The best place and a second one, where both together score at least `least` and leave only noise over."""
    best = fits[0]
    also = _second(response, hypotheses, best)
    if also is None or also.score < margins.place:
        return None
    removed = _pair(response, best, also)
    score = 0.5 * removed - (best.glr - best.score) - (also.glr - also.score)
    surplus = _surplus(response, min(best.onset, also.onset), removed, len(best.size) + len(also.size))
    if score < least or surplus > margins.misfit:
        return None
    choice = choose_kind([fit for fit in fits if fit.place == best.place])
    outcome = Outcome.ONE if len(best.place) == 1 else Outcome.GROUP
    return Finding(outcome, best.place, best, choice, score - max(least, best.score), 1.0, also=also)


def _second(response: Response, hypotheses: Sequence[Hypothesis], first: Fit) -> Fit | None:
    """The best explanation, elsewhere, of what the first leaves over; None where nothing is left."""
    if first.kind is Kind.NOISE:
        return None
    e = response.e - first.basis() @ first.size
    rest = replace(response, e=e, matched=response.impulses.T @ e)
    elsewhere = [h for h in hypotheses if not set(h.place) & set(first.place)]
    fits = scan(rest, elsewhere)
    return fits[0] if fits and fits[0].score > 0.0 and fits[0].kind is not Kind.NOISE else None


def _pair(response: Response, first: Fit, second: Fit) -> float:
    """What two faults together explain of e'e."""
    both = np.concatenate((first.basis(), second.basis()), axis=1)
    fitted = both @ np.linalg.lstsq(both, response.e, rcond=1e-12)[0]
    return float(fitted @ fitted)
