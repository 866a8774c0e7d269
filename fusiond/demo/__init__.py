"""The demonstration: a simulated plant and the real daemon, two processes that close a loop over Zenoh."""

from __future__ import annotations

from collections.abc import Sequence


def run_demo(
    name: str = "minicar",
    duration_s: float = 30.0,
    json_output: bool = False,
    seed: int = 0,
    inject: Sequence[str] = (),
) -> int:
    """`fusiond demo`: see `fusiond.demo.perform`.

    Args:
        name: of the plant and of its configuration.      duration_s: of the plant's time.
        json_output: print the outcome as one JSON object and nothing else.
        seed: of the sensors' noise.      inject: faults of its sensors (`fusiond.simulation.faults`).
    Returns: the exit status: 0 where every part of the verdict holds, otherwise 1.
    Raises: ConfigError.
    """
    # The plant's process runs a module of this package and needs no terminal.
    from fusiond.demo.perform import demonstrate

    return demonstrate(name, duration_s, json_output=json_output, seed=seed, inject=inject)
