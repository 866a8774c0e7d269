"""From what an operator says of plant and cost to a plan: plant, gains, targets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from fusiond.control.contract import Law, Setting
from fusiond.control.plant import Plan, Plant, parts, queued, sampled, targets
from fusiond.errors import ConfigError
from fusiond.models.contract import Process, shape_of
from fusiond.numerics.riccati import Matrix, Unsolvable, generator, regulator
from fusiond.types import Slot

Rows = list[list[float]]
Weight = dict[str, float] | Rows
"""A cost: one weight for each name, or a whole matrix."""


@dataclass(frozen=True, slots=True)
class Wish:
    """What a configuration says: the keyword arguments of the laws that are designed (`lqg.describe` explains them)."""

    controls: list[str]
    state_cost: Weight
    input_cost: Weight
    tracks: list[str] = field(default_factory=list)
    states: list[str] | None = None
    A: Rows | None = None
    B: Rows | None = None
    W: Rows | None = None
    units: list[str] | None = None
    around: dict[str, float] = field(default_factory=dict)
    disturbances: list[str] = field(default_factory=list)
    feedforward: list[float] | None = None
    delay_s: float = 0.0
    integral_cost: dict[str, float] = field(default_factory=dict)


def weights(name: str, said: Weight, names: Sequence[str]) -> Matrix:
    """(k, k) from weights by name or rows; raises ConfigError unless symmetric and positive semi-definite."""
    if isinstance(said, Mapping):
        for key in said:
            if key not in names:
                raise ConfigError(f"{name}: no `{key}`; choose from {', '.join(names)}")
        matrix = np.diag([float(said.get(key, 0.0)) for key in names])
    else:
        shape_of(name, said, len(names), len(names))
        matrix = np.array(said, dtype=float)
    if not np.array_equal(matrix, matrix.T) or np.linalg.eigvalsh(matrix)[0] < -1e-12 * np.trace(matrix):
        raise ConfigError(f"{name}: {said} is not symmetric and positive semi-definite; check its numbers")
    return matrix


@dataclass(frozen=True, slots=True)
class _Part:
    """The controlled part of the model over one period: own states, disturbances, F, B, E, W."""

    states: tuple[str, ...]
    controls: tuple[Slot, ...]
    F: Matrix
    B: Matrix
    E: Matrix
    W: Matrix
    drives: bool


def _own(process: Process, setting: Setting, wish: Wish) -> _Part:
    """The plant is the process model itself: the controls are inputs of it."""
    inputs = {slot.name: place for place, slot in enumerate(process.inputs)}
    for name in wish.controls:
        if name not in inputs:
            known = ", ".join(inputs) or "none"
            raise ConfigError(
                f"controls: `{name}` is no input of the process model (it has {known}); give the plant as A and B"
            )
    motion = setting.motion(wish.around)
    left = [s.name for s in process.states if s.name not in wish.disturbances]
    names = tuple(wish.states or left)
    at = [_place(process, name) for name in names]
    lost = [_place(process, name) for name in wish.disturbances]
    columns = [inputs[name] for name in wish.controls]
    F, B, W = motion.F, motion.B[:, columns], motion.W
    moved = np.abs(B[lost]).max(initial=0.0) + np.abs(F[np.ix_(lost, at)]).max(initial=0.0)
    if moved > 1e-12:
        raise ConfigError("disturbances: one of them depends on the plant; name states that go their own way")
    return _Part(
        names, tuple(process.inputs[column] for column in columns), F[np.ix_(at, at)], B[at],
        F[np.ix_(at, lost)], W[np.ix_(at, at)], True,
    )  # fmt: skip


def _place(process: Process, name: str) -> int:
    return [slot.name for slot in process.states].index(process.slot(name).name)


def _weighed(wish: Wish, states: Sequence[str], controls: Sequence[Slot]) -> Matrix:
    """(n + m, n + m) of state and command."""
    Q = weights("state_cost", wish.state_cost, states)
    R = weights("input_cost", wish.input_cost, [slot.name for slot in controls])
    n = len(Q)
    whole = np.zeros((n + len(R), n + len(R)))
    whole[:n, :n], whole[n:, n:] = Q, R
    return whole


def _given(process: Process, setting: Setting, wish: Wish) -> tuple[_Part, Plant]:
    """The plant is given as x' = A x + B u + w; its states are states of the filter."""
    if wish.states is None or wish.B is None or wish.A is None:
        raise ConfigError("A: a plant of its own needs `states`, `A` and `B`; add what is missing")
    if setting.discrete:
        raise ConfigError("A: this process model is discrete; name its inputs as controls instead")
    n, m = len(wish.states), len(wish.controls)
    shape_of("A", wish.A, n, n)
    shape_of("B", wish.B, n, m)
    for name in wish.states:
        process.slot(name)
    A, B = np.array(wish.A, dtype=float), np.array(wish.B, dtype=float)
    density = np.zeros((n, n))
    if wish.W is not None:
        density = weights("W", wish.W, wish.states)
    units = wish.units or [""] * m
    if len(units) != m:
        raise ConfigError(f'units: has {len(units)} for {m} controls; one for each, "" where there is none')
    controls = tuple(Slot(name, unit) for name, unit in zip(wish.controls, units, strict=True))
    cost = _weighed(wish, wish.states, controls)
    W = noise_of(A, density, setting.period_s)
    plant = sampled(A, B, cost, W, setting.period_s, wish.delay_s)
    part = _Part(tuple(wish.states), controls, *plant.bare, np.zeros((n, 0)), W, False)
    return part, plant


def noise_of(A: Matrix, density: Matrix, dt_s: float) -> Matrix:
    """(n, n) of white noise of spectral density `density` through x' = A x over dt_s (Van Loan 1978)."""
    from scipy.linalg import expm

    n = len(A)
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[:n, n:], block[n:, n:] = -A, density, A.T
    whole = expm(block * dt_s)
    through = whole[n:, n:].T @ whole[:n, n:]
    return np.asarray(0.5 * (through + through.T), dtype=np.float64)


def _sampled_own(setting: Setting, wish: Wish, part: _Part) -> Plant:
    """The process model's own plant, with its queue."""
    density = _weighed(wish, part.states, part.controls)
    periods, rest_s = parts(wish.delay_s, setting.period_s)
    if rest_s > 0.0:
        raise ConfigError(
            f"delay_s: {wish.delay_s:g} s is no whole number of periods ({setting.period_s:g} s), and the command "
            "drives the prediction; choose another rate_hz"
        )
    if setting.discrete:
        return queued(part.F, part.B, density, part.W, periods, setting.period_s)
    A, B = generator(part.F, part.B, setting.period_s)
    return sampled(A, B, density, part.W, setting.period_s, wish.delay_s)


def plan_of(process: Process, setting: Setting, wish: Wish) -> tuple[Plan, _Part]:
    """Plant, gains and targets; raises ConfigError."""
    try:
        if wish.A is not None:
            part, plant = _given(process, setting, wish)
        else:
            part = _own(process, setting, wish)
            plant = _sampled_own(setting, wish, part)
        C = np.array([[float(name == one) for one in part.states] for name in wish.tracks])
        C = C.reshape(len(wish.tracks), len(part.states))
        if not np.allclose(C.sum(axis=1), 1.0):
            raise ConfigError(f"tracks: only states of the plant ({', '.join(part.states)}); name those")
        K, S, L = _gains(plant, C, wish)
    except Unsolvable as error:
        raise ConfigError(
            f"state_cost: no regulator for this plant and cost ({error}); every unstable state must be reached by a "
            "control and seen by the cost"
        ) from error
    rest = np.array(wish.feedforward if wish.feedforward is not None else [0.0] * len(part.controls))
    if len(rest) != len(part.controls):
        raise ConfigError(f"feedforward: has {len(rest)} numbers for {len(part.controls)} controls")
    aims = targets(plant, C, part.E, rest)
    plan = Plan(plant, part.states, tuple(wish.tracks), tuple(wish.disturbances), part.E, K, S, aims, L)
    return plan, part


def _gains(plant: Plant, C: Matrix, wish: Wish) -> tuple[Matrix, Matrix, Matrix]:
    """K, S, and the gain L on the integrals q+ = q + period (C x - reference), where the wish has any."""
    if not wish.integral_cost:
        K, S = regulator(plant.F, plant.B, plant.cost)
        return K, S, np.zeros((plant.controls, 0))
    names = [name for name in wish.tracks if name in wish.integral_cost]
    unknown = set(wish.integral_cost) - set(wish.tracks)
    if unknown or len(names) < len(wish.tracks):
        raise ConfigError("integral_cost: one weight for each state of `tracks`, and no other")
    N, m, r = len(plant.F), plant.controls, len(wish.tracks)
    F = np.eye(N + r)
    F[:N, :N] = plant.F
    F[N:, : plant.states] = plant.period_s * C
    B = np.vstack([plant.B, np.zeros((r, m))])
    cost = np.zeros((N + r + m, N + r + m))
    keep = [*range(N), *range(N + r, N + r + m)]
    cost[np.ix_(keep, keep)] = plant.cost
    cost[N : N + r, N : N + r] = plant.period_s * np.diag([wish.integral_cost[name] for name in wish.tracks])
    K, S = regulator(F, B, cost)
    return K[:, :N], S, K[:, N:]


def law_of(process: Process, plan: Plan, part: _Part, unwinding: float = 0.0) -> Law:
    """The law of a plan, with the parameters that `feedback.command` reads."""
    return Law(
        controls=part.controls,
        references=tuple(process.slot(name) for name in plan.tracked),
        reads=(*plan.states, *plan.disturbances),
        parameters=flat(plan, unwinding),
        memory=plan.L.shape[1],
        queue=plan.plant.queue,
        drives=part.drives,
        plan=plan,
    )


def flat(plan: Plan, unwinding: float) -> tuple[float, ...]:
    """Header (n, m, r, k, D, q, period), K, targets, cost, L, unwinding gain Y, places of the integrated states.

    What a command lacks of what was wanted goes back into the integrals as Y (done - wanted), Y = -unwinding L^+: after
    one such step that share of the lack is gone.
    """
    n, m = plan.plant.states, plan.plant.controls
    r, k = len(plan.tracked), len(plan.disturbances)
    q = plan.L.shape[1]
    header = (n, m, r, k, plan.plant.queue, q, plan.plant.period_s)
    Y = -unwinding * np.linalg.pinv(plan.L) if q else np.zeros((0, m))
    places = [plan.states.index(name) for name in plan.tracked] if q else []
    matrices = (plan.K, plan.targets, plan.plant.cost, plan.L, Y, np.array(places))
    return tuple(float(one) for one in header) + tuple(
        float(one) for matrix in matrices for one in np.asarray(matrix).ravel()
    )
