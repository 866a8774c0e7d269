"""One configuration, several machines: what of it each one runs (`service.role`, `service.nodes`).

A node is a daemon with the updating sensors of its own machine, all inputs, no control, under NAMESPACE/node/NODE; its
sensors publish there, inputs where they always do. What it learns from a reading goes out as a `tracklet` on the key
the sensor would have with a daemon alone. The center is a daemon in whose configuration those sensors are tracklets,
so that silence, late readings, recording and replay are what they are for any sensor.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fusiond.assembly.assembly import Assembly, assemble
from fusiond.assembly.observability import observability
from fusiond.assembly.resolve import Resolved, ResolvedSensor, resolve
from fusiond.assembly.trial import Trial, irregular
from fusiond.config import RESERVED, Config, InputSection, nearest, read
from fusiond.errors import ConfigError

CENTER = "center"
KEPT = ("rate_hz", "noise_std", "noise_covariance", "max_silence_s", "delay_s", "repeats")
"""Settings of a sensor that hold for its tracklets too."""


def load(path: Path, part: str | None = None) -> Assembly:
    """Read a configuration file and assemble the part of one machine; raises ConfigError.

    Args:
        part: a name among `service.nodes`, or `center`; without it, what `service.role` says.
    """
    return assemble(part_of(cast(read(path), part), path.parent), path.parent)


def cast(config: Config, part: str | None) -> Config:
    """The configuration with another role; raises ConfigError."""
    if part is None:
        return config
    if part != CENTER and part not in config.service.nodes:
        raise ConfigError(f"--as {part}: no such node; {nearest(part, {CENTER, *config.service.nodes})}")
    role = {"role": CENTER} if part == CENTER else {"role": "node", "node": part}
    return config.model_copy(update={"service": config.service.model_copy(update=role)})


def part_of(config: Config, folder: Path) -> Config:
    """What the machine of this role runs; raises ConfigError.

    Args:
        folder: where the configuration lies; model files named in it are relative to it.
    """
    check_nodes(config)
    match config.service.role:
        case "node":
            return _node(config, folder)
        case "center":
            return _center(config, folder)
        case _:
            return config


def node_of(config: Config) -> dict[str, str]:
    """The node of each sensor that has one."""
    return {name: node for node, names in config.service.nodes.items() for name in names}


def outer_prefix(config: Config) -> str:
    """The namespace of the whole system, of a configuration that may be a node's part."""
    return config.prefix.removesuffix(f"/node/{config.service.node}")


def check_nodes(config: Config) -> None:
    """Raise ConfigError for nodes that contradict the sensors or the role."""
    service, taken = config.service, dict[str, str]()
    updating = {name for name, said in config.sensor.items() if not isinstance(said, InputSection)}
    for node, names in service.nodes.items():
        subject = f"service.nodes.{node}"
        if node == CENTER or not names:
            raise ConfigError(f"{subject}: needs another name than `{CENTER}` and at least one sensor")
        for name in names:
            if name not in updating:
                what = "drives the prediction everywhere" if name in config.sensor else "is no sensor"
                raise ConfigError(f"{subject}: `{name}` {what}; {nearest(name, updating)}")
            if name in taken:
                raise ConfigError(f"{subject}: `{name}` is at `{taken[name]}` too; leave it to one node")
            taken[name] = node
    if service.role == CENTER and not service.nodes:
        raise ConfigError('service.nodes: names no node; add them, or leave role = "alone"')
    if service.role == "node" and service.node not in service.nodes:
        said = "is missing" if service.node is None else f"has no node `{service.node}` to name"
        raise ConfigError(f"service.node: {said}; {nearest(str(service.node), service.nodes)}")


def _changed(config: Config, changes: Mapping[str, Any], without: Iterable[str] = ()) -> Config:
    """The configuration with whole sections replaced or, where None, left out."""
    said = config.model_dump(exclude_unset=True) | dict(changes)
    return Config.model_validate({key: value for key, value in said.items() if key not in set(without)})


def _accepting(config: Config, names: Iterable[str]) -> Config:
    """The configuration with more states that may stay unobserved."""
    accepted = [*dict.fromkeys([*config.filter.accept_unobservable, *names])]
    chosen = config.filter.model_copy(update={"accept_unobservable": accepted})
    return config.model_copy(update={"filter": chosen})


def _node(config: Config, folder: Path) -> Config:
    """The part of one node. It must see what its sensors' linearisation depends on; the rest may stay unseen."""
    node = str(config.service.node)
    prefix = f"{config.prefix}/node/{node}"
    sensors: dict[str, Any] = {}
    for name, section in config.sensor.items():
        said = section.model_dump(exclude_unset=True)
        if isinstance(section, InputSection):
            sensors[name] = said | {"key": config.key_of(name)}
        elif name in config.service.nodes[node]:
            standing = f"{prefix}/{name}" if name in RESERVED else f"{prefix}/sensor/{name}"
            sensors[name] = said | {"key": section.key or standing}
    mine = _changed(config, {"namespace": prefix, "sensor": sensors}, without=("control", "fusion"))
    resolved = resolve(mine, folder)
    vector_only(resolved)
    needed = {
        state for sensor in resolved.updating if bends(resolved, sensor) for state in sensor.model.reads
    }
    return _accepting(mine, (slot.name for slot in resolved.process.states if slot.name not in needed))


def _center(config: Config, folder: Path) -> Config:
    """The part of the center. The whole system is judged first, by the models that the center itself does without."""
    resolved = assemble(config, folder).resolved
    vector_only(resolved)
    nodes = node_of(config)
    sensors: dict[str, Any] = {
        name: section.model_dump(exclude_unset=True)
        for name, section in config.sensor.items()
        if name not in nodes
    }
    for sensor in resolved.updating:
        if sensor.name in nodes:
            sensors[sensor.name] = _tracklet(resolved, sensor, nodes[sensor.name])
    mine = _changed(config, {"sensor": sensors})
    tracked = resolve(mine, folder)
    return _accepting(mine, observability(tracked, tracked.updating).unobserved)


def _tracklet(resolved: Resolved, sensor: ResolvedSensor, node: str) -> dict[str, Any]:
    """The section of a node's sensor at the center; raises ConfigError where its silence would not be noticed."""
    model, section = sensor.model, sensor.section
    assert section is not None
    if section.rate_hz is None and section.max_silence_s is None:
        raise ConfigError(
            f"sensor.{sensor.name}: has no rate_hz, so that nobody would notice when node `{node}` is gone; "
            "add it, or max_silence_s"
        )
    measured = model.channels[: model.dof]
    trial = Trial(resolved)
    places = [[slot.name for slot in resolved.process.states].index(name) for name in model.reads]
    said = section.model_dump(exclude_unset=True)
    return {name: said[name] for name in KEPT if name in said} | {
        "kind": "tracklet",
        "channels": [slot.name for slot in measured],
        "units": [slot.unit for slot in measured],
        "wraps": list(model.wraps),
        "reads": list(model.reads),
        "H": trial.look(sensor, trial.start())[1][:, places].tolist(),
        "valid": {slot.key: section.valid[slot.key] for slot in measured if slot.key in section.valid},
    }


def vector_only(resolved: Resolved) -> None:
    """Raise ConfigError for a model whose state is no vector: a tracklet could not say where it was linearised."""
    if resolved.process.errors:
        raise ConfigError(
            'service.role: the state of this model is no vector, which nodes cannot share; leave it at "alone"'
        )


def bends(resolved: Resolved, sensor: ResolvedSensor) -> bool:
    """Whether a sensor's H depends on the state, so that what it says depends on where it is linearised."""
    trial = Trial(resolved)
    x = trial.start()
    moved = trial.shift(x, irregular(x.shape[0], 1))
    return not np.array_equal(trial.look(sensor, x)[1], trial.look(sensor, moved)[1])
