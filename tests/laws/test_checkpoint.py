"""A checkpoint is all that an engine remembers: whoever goes on from it goes on to the same bits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fusiond.assembly.assembly import assemble, load
from fusiond.config import parse
from fusiond.engine.checkpoint import checkpoint, resume
from fusiond.simulation.registry import simulate
from tools.pages.trials import records

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
AVERAGED = """
[fusion]
topology = "seed_averaged"
"""


def with_faults(name):
    return load(CONFIGS / f"{name}.toml")


def overseen():
    """A plain topology that a compiled engine judges beside it."""
    text = (CONFIGS / "reference_plant.toml").read_text(encoding="utf-8")
    return assemble(parse(text + AVERAGED, "reference_plant"), CONFIGS)


def scrambled(readings, horizon):
    """Every block of `horizon` readings in any order: some come late."""
    rng = np.random.default_rng(3)
    blocks = [
        rng.permutation(readings[first : first + horizon]) for first in range(0, len(readings), horizon)
    ]
    return np.concatenate(blocks)


@pytest.mark.parametrize(
    ("name", "for_s", "bias"), [("minicar", 20.0, 0.5), ("reference_plant", 200.0, 10.0)]
)
def test_an_engine_goes_on_from_a_checkpoint_to_the_same_bits(name, for_s, bias):
    """A biased sensor is found before, late readings come after: history, window and verdicts are all handed on."""
    assembly = with_faults(name)
    simulation = simulate(name, 0, for_s)
    readings = scrambled(records(assembly.layout, simulation.readings), 6)
    sensor = next(s.number for s in assembly.layout.sensors if s.name in {"ultrasonic", "y1"})
    lies = (readings["sensor"] == sensor) & (readings["t_ns"] > np.median(readings["t_ns"]) * 0.8)
    readings["z"][lies, 0] += bias
    half = len(readings) // 2
    first, second = assembly.engine(), assembly.engine()
    first.process(readings[:half])
    notes = resume(second, checkpoint(first, "same", {"seq": 3}), "same")
    expected, found = first.process(readings[half:]), second.process(readings[half:])
    assert notes == {"seq": 3}
    assert found.tobytes() == expected.tobytes()
    assert (expected["fault"][:, sensor] != 0).any(), "the lie was never found"
    for name_, memory in first.memory().items():
        if name_ != "work":
            assert second.memory()[name_].tobytes() == memory.tobytes(), name_


def test_a_plain_engine_hands_on_its_overseer_too():
    assembly = overseen()
    if assembly.overseer is None:
        pytest.fail("the configuration has no overseer")
    readings = records(assembly.layout, simulate("reference_plant", 0, 4.0).readings)
    half = len(readings) // 2
    first, second = assembly.engine(), assembly.engine()
    first.process(readings[:half])
    resume(second, checkpoint(first, "same", {}), "same")
    assert second.process(readings[half:]).tobytes() == first.process(readings[half:]).tobytes()
    overseers = [engine.memory()["overseer.track"].tobytes() for engine in (first, second)]
    assert overseers[0] == overseers[1]


def test_what_is_no_checkpoint_changes_nothing():
    assembly = with_faults("reference_plant")
    readings = records(assembly.layout, simulate("reference_plant", 0, 2.0).readings)
    engine = assembly.engine()
    data = checkpoint(engine, "one", {})
    engine.process(readings)
    before = engine.state_sha256()
    flipped = bytearray(data)
    flipped[len(data) // 2] ^= 1
    for bad, said in ((b"", "sound"), (bytes(flipped), "sound"), (data[:-9], "sound")):
        with pytest.raises(ValueError, match=said):
            resume(engine, bad, "one")
    with pytest.raises(ValueError, match="another configuration"):
        resume(engine, data, "other")
    assert engine.state_sha256() == before
