"""Nodes and their center on simulated logs, through the engines and the wire's own bytes, beside a daemon alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.assembly.assembly import Assembly, assemble
from fusiond.config import Config
from fusiond.engine.engine import Engine
from fusiond.service.roles import CENTER, cast, part_of
from fusiond.service.tracklets import Tracklets
from fusiond.service.wire import Decoder
from fusiond.simulation.tables import Reading, Simulation
from tools.pages.consistency import Check, mean_of_squares
from tools.pages.trials import CONFIGS, Floats, Records, Trial, configured, errors, estimate, records

PUBLISH_NS = 20_000_000
"""A daemon's `publish_hz` of 50: how old the center's estimate is where a node linearises."""


@dataclass(frozen=True, slots=True)
class Machine:
    """One machine's part of a configuration, with its engine."""

    assembly: Assembly
    engine: Engine


class System:
    """All machines of one configuration, and the daemon that would do without them.

    Args:
        name: of a file in configs/.   changes: as for `configured`; its nodes are those of `service.nodes`.
    """

    def __init__(self, name: str, changes: Mapping[str, Any] | None = None) -> None:
        whole = configured(name, changes)
        self.alone = Machine(whole, whole.engine())
        self.center = self._part(whole.config, CENTER)
        self.nodes = [self._part(whole.config, node) for node in whole.config.service.nodes]
        self._decoder = Decoder(self.center.assembly.layout)

    @staticmethod
    def _part(config: Config, name: str) -> Machine:
        assembly = assemble(part_of(cast(config, name), CONFIGS), CONFIGS)
        return Machine(assembly, assembly.engine())

    def both(
        self, simulation: Simulation, first: Sequence[Reading] = (), born_ns: int = 0
    ) -> tuple[Trial, Trial]:
        """The daemon alone and the center on one log, readings in the order of time.

        Args:
            born_ns: when the last node is started anew; 0 never.
        """
        return estimate(self.alone.engine, simulation, first), self._center(simulation, first, born_ns)

    def _center(self, simulation: Simulation, first: Sequence[Reading], born_ns: int) -> Trial:
        layout, engine = self.center.assembly.layout, self.center.engine
        engine.reset()
        nodes = [Sending(node, [*first, *simulation.readings]) for node in self.nodes]
        reports: list[Records] = []
        covariances: list[Floats] = []
        hear_none = {"health": "invalid", "state": []}
        for sending in nodes:
            sending.tracklets.center.estimate(hear_none)
        for slot_ns in sorted({int(t_ns) for sending in nodes for t_ns in sending.slots}):
            if born_ns and slot_ns >= born_ns and nodes[-1].epoch == 1:
                nodes[-1].start_anew()
            given = self._arrived(nodes, slot_ns)
            if len(given):
                reports.append(engine.process(given, covariances=True).copy())
                covariances.append(engine.covariances[: len(given)].copy())
                said = reports[-1][-1]
                estimate = {"health": "nominal", "state": said["x"].tolist(), "t_ns": said["state_t_ns"]}
                for sending in nodes:
                    sending.tracklets.center.estimate(estimate)
        whole = np.concatenate(reports)
        return Trial(layout, whole, np.concatenate(covariances), errors(layout, whole, simulation))

    def _arrived(self, nodes: Sequence[Sending], slot_ns: int) -> Records:
        """What the nodes send in one slot of time, in the center's order."""
        self._decoder.begin()
        numbers = self.center.assembly.layout.numbers
        for sending in nodes:
            for name, encoding, payload in sending.puts(slot_ns):
                self._decoder.add(numbers[name], 0, encoding, payload)
        given = self._decoder.readings().copy()
        assert not self._decoder.refusals.counts
        return given[np.lexsort((given["sensor"], given["t_ns"]))]


class Sending:
    """One node on one log, slot by slot of PUBLISH_NS, as the center's estimate comes back to it."""

    def __init__(self, node: Machine, readings: Sequence[Reading]) -> None:
        self.layout, self.node, self.epoch = node.assembly.layout, node, 0
        given = records(self.layout, readings)
        self._given = given[np.lexsort((given["sensor"], given["t_ns"]))]
        self.slots = self._given["t_ns"] // PUBLISH_NS * PUBLISH_NS
        self.start_anew()

    def start_anew(self) -> None:
        """Forget everything, as a process that is started again; it has not heard the center yet."""
        self.epoch += 1
        self.node.engine.reset()
        self.tracklets = Tracklets(self.node.assembly.resolved, self.layout, self.epoch)

    def puts(self, slot_ns: int) -> list[tuple[str, str, bytes]]:
        """What goes out in one slot: sensor, encoding, payload."""
        begin, end = np.searchsorted(self.slots, [slot_ns, slot_ns + 1])
        given = self._given[begin:end]
        if not len(given):
            return []
        found = self.tracklets.puts(given, self.node.engine.process(given))
        return [(self.layout.sensors[number].name, encoding, payload) for number, encoding, payload in found]


@dataclass(frozen=True, slots=True)
class Outcome:
    """Daemon alone and center over independent runs.

    apart: largest difference of their states, in the daemon's deviations, over all stamps.
    rmse: root of the mean of e' D^-1 e / n over all stamps, D the daemon's variances: 1 where as good as it says.
    nees: mean at the last stamp of each run, with its band.
    """

    apart: float
    rmse_alone: float
    rmse_center: float
    nees_alone: Check
    nees_center: Check


def outcome(system: System, simulations: Sequence[Simulation], born_ns: int = 0) -> Outcome:
    """Run every simulated log through both; `born_ns` as for `System.both`."""
    apart, squares, last = 0.0, np.zeros(2), np.zeros(2)
    numbers = 0
    for simulation in simulations:
        trials = system.both(simulation, (), born_ns)
        at = shared_stamps(*trials)
        std = trials[0].reports["std"][at[0]]
        off = [trial.error[rows] / std for trial, rows in zip(trials, at, strict=True)]
        apart = max(apart, float(np.abs(off[1] - off[0]).max()))
        squares += [float(np.sum(each**2)) for each in off]
        last += [float(trial.nees(rows[-1:])[0]) for trial, rows in zip(trials, at, strict=True)]
        numbers += std.size
    n = len(system.alone.assembly.layout.states)
    checks = [mean_of_squares(float(total), n * len(simulations), n) for total in last]
    rmse: Floats = np.sqrt(squares / numbers)
    return Outcome(apart, float(rmse[0]), float(rmse[1]), checks[0], checks[1])


def shared_stamps(a: Trial, b: Trial) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows of both after which everything of a stamp is in, of the stamps that both have."""
    of_a, of_b = a.last_of_each_stamp(), b.last_of_each_stamp()
    in_a, in_b = a.reports["t_ns"][of_a], b.reports["t_ns"][of_b]
    return of_a[np.isin(in_a, in_b)], of_b[np.isin(in_b, in_a)]
