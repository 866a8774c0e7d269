"""Which kind of fault: left open until the likelihoods part.

A change of noise, a spike and a lasting error (bias, drift, scale, delay) are told apart by a margin of ln 100, as the
reactions differ; until then the kind stays open. What is compared is the evidence of a family, its members and their
onsets left open: of the best member at its best onset alone, the one with more of them to choose from would look too
good, and noise with a few readings alike would be called a bias too often.
Among lasting errors the simplest, bias, is named until another explains more by `SHAPE`; what lies closer than that is
listed beside the one named.

Source: the evidence of a model, MacKay 2003, chapter 28; a ratio of evidences that is watched until it passes 100 does
so wrongly in one case of a hundred at most (Ville 1939), noise of every size that is expected beforehand taken
together; of ten sigma it was 1.7 %. Test: tests/calibration/test_kinds_named.py.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from fusiond.faults.glr import RARITY, Fit
from fusiond.types import Kind

FAMILY = math.log(100.0)
"""Log likelihood between families of kinds that react differently."""
SPIKE = 2.0 * FAMILY
"""The same for a spike: noise, too, has quiet moments after a loud one, and nothing is lost by waiting."""
SHAPE = 2.0
"""Score by which another lasting error must outdo a bias to be named instead; one closer than that is listed beside."""
LASTING = (Kind.BIAS, Kind.DRIFT, Kind.SCALE, Kind.DELAY)


@dataclass(frozen=True, slots=True)
class Choice:
    """The kind named, NONE while open; what it may also be; the fit of the kind named; margin over other families."""

    kind: Kind
    alternatives: tuple[Kind, ...] = ()
    fit: Fit | None = None
    margin: float = 0.0


def _lasting(best: dict[Kind, Fit]) -> tuple[Fit, tuple[Kind, ...]] | None:
    """The lasting error to name, and those that may be it as well."""
    found = [best[kind] for kind in LASTING if kind in best]
    if not found:
        return None
    top = max(found, key=lambda fit: fit.score)
    bias = best.get(Kind.BIAS)
    named = bias if bias is not None and top.score - bias.score <= SHAPE else top
    close = tuple(fit.kind for fit in found if fit is not named and named.score - fit.score <= SHAPE)
    return named, close


def _evidence(members: Sequence[Fit]) -> float:
    """Log evidence of a family: the mean of its members' likelihoods, each as often as its kind, beforehand."""
    top = max(fit.evidence for fit in members)
    odds = math.fsum(math.exp(-RARITY.get(fit.kind, 0.0)) for fit in members)
    return top + math.log(math.fsum(math.exp(fit.evidence - top) for fit in members) / odds)


def choose_kind(fits: Sequence[Fit]) -> Choice:
    """Name the kind of a fault in one place.

    Args:
        fits: of that place, the best score first.
    """
    best: dict[Kind, Fit] = {}
    for fit in fits:
        best.setdefault(fit.kind, fit)
    lasting = _lasting(best)
    families: list[tuple[float, Fit, tuple[Kind, ...]]] = [
        (best[kind].evidence, best[kind], ()) for kind in (Kind.NOISE, Kind.SPIKE) if kind in best
    ]
    if lasting is not None:
        families.append((_evidence([best[kind] for kind in LASTING if kind in best]), *lasting))
    families.sort(key=lambda family: -family[0])
    score, fit, close = families[0]
    margin = score - families[1][0] if len(families) > 1 else score
    if margin < (SPIKE if fit.kind is Kind.SPIKE else FAMILY):
        open_kinds = tuple(f.kind for s, f, _ in families if score - s < FAMILY)
        return Choice(Kind.NONE, open_kinds + close, fit, margin)
    return Choice(fit.kind, close, fit, margin)
