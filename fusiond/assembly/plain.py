"""The plain step of a configuration: when one is needed, its tables, and its package of source files.

The package is the compiled step's with the compiler taken away: `fusiond.engine.plain` replaces the files that touch a
covariance, `fusiond.numerics` stands in it once more with a `kernel.py` that decorates nothing. Nothing of it is
stale when cached: its folder is named by the hash of all it is made of.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fusiond import adapt, numerics
from fusiond.assembly.observability import trial_interval_s
from fusiond.assembly.package import folder_sources
from fusiond.assembly.resolve import Resolved, ResolvedSensor
from fusiond.assembly.trial import Trial
from fusiond.config import Config
from fusiond.engine import plain, step
from fusiond.engine.layout import Layout
from fusiond.engine.plain.records import DRAWS, plain_design_dtype
from fusiond.errors import ConfigError
from fusiond.filters.conventional import predict
from fusiond.filters.information import weight
from fusiond.filters.innovation import Innovation, right_divide
from fusiond.filters.joseph import update
from fusiond.fusion.federated import shares
from fusiond.types import Role

LOCAL = frozenset({"federated", "federated_reset", "information_sum", "covariance_intersection"})
"""Topologies with a local filter for each sensor."""
SHARED = frozenset({"federated", "federated_reset"})
"""Those whose local filters hold only a share of prior and process information."""
BATCH = frozenset({"stacked", "information", "seed_averaged"})
"""Topologies that fuse all readings of one stamp together."""
OWN_UPDATE = frozenset({"information", "seed_averaged"})
"""Topologies that are an update of their own, whatever the recursion."""
SEED_DEVIATION = {
    "variance": 1e-7, "deviation": 1e-14, "identity_variance": 1e-2, "identity_deviation": 1e-4,
}  # fmt: skip
"""Standard deviation of o_ii in each reading of seed 004's N(0, 1e-14) and N(0, 1e-4)."""
ALWAYS = (
    "apply.py",
    "circle.py",
    "finish.py",
    "looking.py",
    "noise.py",
    "recursion.py",
    "spread.py",
    "update.py",
)
"""Files of a plain step that no configuration replaces."""
KERNELS = ("fuzzy.py", "fuzzy_additive.py", "guards.py", "interacting.py", "slow.py", "variational.py")
"""Files of `fusiond.adapt` that a step calls."""
LOOKS = 60
"""Looks after which the relative information of the sensors is taken: the reference plant rests after 60."""


def is_plain(config: Config) -> bool:
    """Whether the configuration needs a plain step."""
    return config.filter.recursion != "ud" or config.fusion.topology != "centralized"


def policy_of(config: Config) -> str:
    """How an unsound covariance is repaired."""
    return config.filter.guard or ("seed" if config.filter.recursion == "seed" else "eigen_floor")


def check_choices(config: Config) -> None:
    """Raise ConfigError for settings that contradict each other or would be ignored."""
    chosen, topology = config.filter, config.fusion.topology
    if topology in OWN_UPDATE and chosen.recursion != "ud":
        raise ConfigError(
            f"filter.recursion: `{chosen.recursion}` has no effect, the topology `{topology}` is an update of its "
            f"own; leave it out"
        )
    watched = chosen.recursion != "ud" or topology in {*OWN_UPDATE, "information_sum"}
    if chosen.guard and not watched:
        raise ConfigError(
            "filter.guard: the recursion ud needs none, its covariance is sound by construction; leave it out"
        )
    if policy_of(config) != "seed" and "seed_diagonal" in chosen.model_fields_set:
        raise ConfigError('filter.seed_diagonal: only the repair of the seed has one; add guard = "seed"')


def information_of(resolved: Resolved) -> list[float]:
    """How much each updating sensor tells, unit-free: tr(H P H' R^-1), P the predicted covariance of all together.

    P is that of a trial run of LOOKS looks, so that the answer depends on neither units nor the initial covariance.
    """
    trial = Trial(resolved)
    n, dt_s = len(resolved.process.states), trial_interval_s(resolved)
    x, P = trial.start(), np.eye(n)
    held = np.zeros(len(resolved.process.inputs))
    for look in range(LOOKS):
        for sensor in resolved.updating:
            x_seen = Innovation(np.zeros(sensor.model.dof), trial.look(sensor, x, look)[1], sensor.R)
            _, P = update(x, P, x_seen)
        Q = trial.disturbance(x, dt_s)
        x, F, _ = trial.move(x, held, dt_s)
        P = predict(P, F, Q)
    return [_told(trial, sensor, x, P) for sensor in resolved.updating]


def _told(trial: Trial, sensor: ResolvedSensor, x: NDArray[np.float64], P: NDArray[np.float64]) -> float:
    """tr(H P H' R^-1) of one sensor; a perfect channel counts as a million times as good as the state is known."""
    H = trial.look(sensor, x)[1]
    seen, R = H @ P @ H.T, sensor.R
    if weight(R) is None:
        R = R + 1e-6 * np.diag(np.diagonal(seen))
    return float(np.trace(right_divide(seen, R)))


def plain_design(resolved: Resolved, layout: Layout, design: NDArray[np.void]) -> NDArray[np.void]:
    """(1,) the compiled step's tables, with rows and shares of local filters and the random diagonals."""
    record = np.zeros(1, plain_design_dtype(layout.shape))
    for name in design.dtype.names or ():
        record[name] = design[name]
    config = resolved.config
    record["local"], record["share"] = -1, 1.0
    if config.fusion.topology in LOCAL:
        numbers = [k for k, sensor in enumerate(resolved.sensors) if sensor.role is Role.UPDATE]
        record["local"][0, numbers] = np.arange(1, len(numbers) + 1)
    if config.fusion.topology in SHARED:
        record["share"][0, 1:] = shares(information_of(resolved))
    rng = np.random.default_rng(config.filter.random_seed)
    deviation = SEED_DEVIATION[config.filter.seed_diagonal]
    record["draws"][0] = np.abs(deviation * rng.standard_normal((DRAWS, layout.shape.states)))
    return record


def plain_sources(config: Config, files: Mapping[str, str], *, linear: bool) -> dict[str, str]:
    """Every file of a plain step's package.

    Args:
        files: those of the compiled step (`package.step_sources`).
    """
    template, own, topology = folder_sources(step), folder_sources(plain), config.fusion.topology
    chosen = {name: own[name] for name in ALWAYS}
    chosen["advance.py"] = own["advance_linear.py" if linear else "advance_nonlinear.py"]
    chosen["correct.py"] = own["correct.py"]
    if topology in LOCAL:
        chosen |= {
            "correct.py": own["local.py"],
            "predict.py": own["predict.py"],
            "master.py": own["master.py"],
        }
    elif topology in BATCH:
        chosen["correct.py"] = own["batch.py"]
    beside = folder_sources(numerics) | {"kernel.py": own["kernel.py"]}
    if config.adaptation is not None:
        chosen["noise.py"] = own["noise_on.py"]
        beside |= {name: text for name, text in folder_sources(adapt).items() if name in KERNELS}
    behind = {f"step_{name}": files[name] for name in files if name in chosen and name != "advance.py"}
    if linear:
        behind["step_advance.py"] = template["advance.py"]
    files = {**files, "decided.py": template["decided.py"]}
    told = {"RECURSION": config.filter.recursion, "TOPOLOGY": topology, "POLICY": policy_of(config)}
    chosen["choices.py"] = "".join(f"{name} = {value!r}\n" for name, value in told.items())
    del beside["__init__.py"]
    whole = {**beside, **files, **behind, **chosen}
    return {name: _neighbourly(text, whole) for name, text in whole.items()}


def _neighbourly(text: str, files: Mapping[str, str]) -> str:
    """A source whose imports from `fusiond.numerics` and `fusiond.engine.step` go to the files beside it."""

    def neighbour(match: re.Match[str]) -> str:
        name = match["name"]
        return f"from .step_{name} import" if f"step_{name}.py" in files else f"from .{name} import"

    text = re.sub(r"from fusiond\.engine\.step\.(?P<name>\w+) import", neighbour, text)
    kernels = "|".join(name.removesuffix(".py") for name in KERNELS)
    text = re.sub(rf"from fusiond\.adapt\.(?P<name>{kernels}) import", r"from .\g<name> import", text)
    return re.sub(r"from fusiond\.numerics\.(?P<name>\w+) import", r"from .\g<name> import", text)
