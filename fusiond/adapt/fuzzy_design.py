"""The fuzzy rules, evaluated at design time by scikit-fuzzy into a table.

Mamdani: a rule cuts its output set at the product of its inputs' memberships, the cut sets are joined by their maximum,
and the centroid of the whole is the answer. (With the minimum instead of the product the surface would have an edge
across both inputs, which no table of a reasonable size follows.)

scikit-fuzzy takes a good half millisecond for one evaluation and makes NaN of NaN; the step reads a table instead, in
which it interpolates (`fusiond.adapt.fuzzy.look_up`). Its error against scikit-fuzzy is held below 1e-3 by a test.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

SCATTER, MEAN, CHANGE = (-3.0, 3.0), (0.0, 5.0), (-1.5, 1.5)
"""Universes of the two inputs and of the output."""
ROW_PIECES, COLUMN_PIECES = 16, 24
"""Intervals of the table between two corners of the sets of scatter, and of mean, where any membership changes."""
ROWS = 121
"""Points of the table of the published design."""
FINE = 601
"""Points of the universe over which scikit-fuzzy takes its centroids."""
ANY = "any"
MATCHING = (-4.0, 4.0)
"""Degree of matching of the published design, in declared variances, limited to this."""

Sets = Mapping[str, Sequence[float]]
MATCHING_SETS: Sets = {"N": (-4.0, -4.0, -1.0, 0.0), "Z": (-1.0, 0.0, 0.0, 1.0), "P": (0.0, 1.0, 4.0, 4.0)}
AMOUNTS: Sets = {
    "increase": (0.5, 1.0, 1.0, 1.5), "maintain": (-0.5, 0.0, 0.0, 0.5), "decrease": (-1.5, -1.0, -1.0, -0.5),
}  # fmt: skip
"""Sets of the published design."""
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Rules:
    """Fuzzy sets of both inputs and of the output as trapezoids, and rules (scatter, mean, change)."""

    scatter: Sets
    mean: Sets
    change: Sets
    rules: Sequence[Sequence[str]]


def _axis(name: str, span: tuple[float, float], sets: Sets, *, output: bool = False) -> Any:
    """A variable of scikit-fuzzy with its sets."""
    import skfuzzy
    from skfuzzy import control

    universe = np.linspace(*span, FINE)
    axis = (control.Consequent if output else control.Antecedent)(universe, name)
    for label, corners in sets.items():
        axis[label] = skfuzzy.trapmf(universe, list(corners))
    return axis


def _rule(scatter: Any, mean: Any, change: Any, words: Sequence[str]) -> Any:
    """One rule; `any` leaves an input out."""
    from skfuzzy import control

    asked = [axis[word] for axis, word in zip((scatter, mean), words[:2], strict=True) if word != ANY]
    both = asked[0] if len(asked) == 1 else asked[0] & asked[1]
    return control.Rule(both, change[words[2]], and_func=np.multiply)


def _computed(simulation: Any) -> Floats:
    """The output `change` of a simulation with its inputs set."""
    with warnings.catch_warnings():
        # scikit-fuzzy 0.5.0 calls np.maximum in a way that numpy is going to forbid
        warnings.simplefilter("ignore", DeprecationWarning)
        simulation.compute()
    return np.asarray(simulation.output["change"], dtype=np.float64)


def evaluate(rules: Rules, scatter: Floats, mean: Floats) -> Floats:
    """(k,) what scikit-fuzzy answers at (k,) points, inputs within their universes."""
    from skfuzzy import control

    axes = (
        _axis("scatter", SCATTER, rules.scatter), _axis("mean", MEAN, rules.mean),
        _axis("change", CHANGE, rules.change, output=True),
    )  # fmt: skip
    system = control.ControlSystem([_rule(*axes, words) for words in rules.rules])
    simulation = control.ControlSystemSimulation(system, cache=False)
    simulation.input["scatter"], simulation.input["mean"] = scatter, mean
    return _computed(simulation)


def table_of(rules: Rules) -> Floats:
    """(rows, columns) the control surface at the points of both axes."""
    rows, columns = axes_of(rules)
    scatter, mean = np.meshgrid(rows, columns, indexing="ij")
    return evaluate(rules, scatter.ravel(), mean.ravel()).reshape(len(rows), len(columns))


def axes_of(rules: Rules) -> tuple[Floats, Floats]:
    """Where the table has its points along scatter and along mean."""
    return points(rules.scatter, SCATTER, ROW_PIECES), points(rules.mean, MEAN, COLUMN_PIECES)


def points(sets: Sets, span: tuple[float, float], pieces: int) -> Floats:
    """Every corner of the sets within the span, and `pieces` intervals between two where a membership changes."""
    corners = np.unique(np.clip([*span, *(x for corner in sets.values() for x in corner)], *span))
    found = [corners[:1]]
    for low, high in pairwise(corners):
        slopes = any((a <= low and high <= b) or (c <= low and high <= d) for a, b, c, d in sets.values())
        found.append(np.linspace(low, high, (pieces if slopes else 1) + 1)[1:])
    return np.concatenate(found)


def matching_table() -> Floats:
    """(ROWS, 2) the published design: sets N, Z, P of the degree of matching, and R rises, stays or falls by addition.

    Its single input lies along the rows; the change is in units of its largest step.
    """
    import skfuzzy
    from skfuzzy import control

    matching = control.Antecedent(np.linspace(*MATCHING, FINE), "matching")
    change = control.Consequent(np.linspace(*CHANGE, FINE), "change")
    for axis, sets in ((matching, MATCHING_SETS), (change, AMOUNTS)):
        for label, corners in sets.items():
            axis[label] = skfuzzy.trapmf(axis.universe, list(corners))
    said = {"N": "increase", "Z": "maintain", "P": "decrease"}
    system = control.ControlSystem([control.Rule(matching[a], change[b]) for a, b in said.items()])
    simulation = control.ControlSystemSimulation(system, cache=False)
    simulation.input["matching"] = np.linspace(*MATCHING, ROWS)
    return np.repeat(_computed(simulation)[:, None], 2, axis=1)
