"""The health of a center's nodes: a node is silent while all of its sensors are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fusiond.engine.layout import Layout
from fusiond.types import Health

SILENT = int(Health.SILENT)


class NodeWatch:
    """The nodes of one center; without any, it says nothing. Before the first report all are healthy, as sensors are.

    Args:
        nodes: the sensors of each.
    """

    def __init__(self, layout: Layout, nodes: Mapping[str, Sequence[str]]) -> None:
        self._numbers = {node: [layout.numbers[name] for name in names] for node, names in nodes.items()}
        self._node = {name: node for node, names in nodes.items() for name in names}
        self._silent = dict.fromkeys(nodes, False)

    def subject(self, sensor: str) -> str:
        """A sensor as an operator should read it: with its node."""
        return f"node {self._node[sensor]}, {sensor}" if sensor in self._node else sensor

    def observe(self, health: Sequence[int]) -> list[str]:
        """What there is to say of the nodes, given the health of every sensor by number."""
        said = []
        for node, numbers in self._numbers.items():
            silent = all(health[number] == SILENT for number in numbers)
            if silent != self._silent[node]:
                self._silent[node] = silent
                what = "silent; the estimate goes on without it" if silent else "back; its sensors are used"
                said.append(f"node {node}: {what}")
        return said

    def status(self) -> dict[str, str]:
        """`healthy` or `silent` of each node."""
        labels = {True: Health.SILENT.label, False: Health.HEALTHY.label}
        return {node: labels[silent] for node, silent in self._silent.items()}
