"""The fuzzy rules, evaluated at design time by scikit-fuzzy (Mamdani: minimum, maximum, centroid) into a table.

scikit-fuzzy takes a good half millisecond for one evaluation and makes NaN of NaN; the step reads a table instead, in
which it interpolates (`fusiond.adapt.fuzzy.look_up`). Its error against scikit-fuzzy is held below 1e-3 by a test.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

SCATTER, MEAN, CHANGE = (-3.0, 3.0), (0.0, 5.0), (-1.5, 1.5)
"""Universes of the two inputs and of the output."""
ROWS, COLUMNS = 121, 41
"""Points of the table along scatter and along mean."""
FINE = 601
"""Points of the universe over which scikit-fuzzy takes its centroids."""
ANY = "any"
MATCHING = (-4.0, 4.0)
"""Degree of matching of the published design, in declared variances, limited to this."""

Sets = Mapping[str, Sequence[float]]
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
    return control.Rule(asked[0] if len(asked) == 1 else asked[0] & asked[1], change[words[2]])


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
    simulation.compute()
    return np.asarray(simulation.output["change"], dtype=np.float64)


def table_of(rules: Rules) -> Floats:
    """(ROWS, COLUMNS) the control surface, from the smallest to the largest of both inputs."""
    scatter, mean = np.meshgrid(np.linspace(*SCATTER, ROWS), np.linspace(*MEAN, COLUMNS), indexing="ij")
    return evaluate(rules, scatter.ravel(), mean.ravel()).reshape(ROWS, COLUMNS)


def matching_table() -> Floats:
    """(ROWS, 2) the published design: sets N, Z, P of the degree of matching, and R rises, stays or falls by addition.

    Its single input lies along the rows; the change is in units of its largest step.
    """
    import skfuzzy
    from skfuzzy import control

    matching = control.Antecedent(np.linspace(*MATCHING, FINE), "matching")
    change = control.Consequent(np.linspace(*CHANGE, FINE), "change")
    for label, corners in {"N": [-4, -4, -1, 0], "Z": [-1, 0, 0, 1], "P": [0, 1, 4, 4]}.items():
        matching[label] = skfuzzy.trapmf(matching.universe, corners)
    for label, corners in {"increase": [0.5, 1, 1, 1.5], "maintain": [-0.5, 0, 0, 0.5], "decrease": [-1.5, -1, -1, -0.5]}.items():  # fmt: skip
        change[label] = skfuzzy.trapmf(change.universe, corners)
    said = {"N": "increase", "Z": "maintain", "P": "decrease"}
    system = control.ControlSystem([control.Rule(matching[a], change[b]) for a, b in said.items()])
    simulation = control.ControlSystemSimulation(system, cache=False)
    simulation.input["matching"] = np.linspace(*MATCHING, ROWS)
    simulation.compute()
    return np.repeat(np.asarray(simulation.output["change"], dtype=np.float64)[:, None], 2, axis=1)
