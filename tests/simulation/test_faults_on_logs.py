"""Faults on a recording, and inside simulated sensors: the same lies wherever they are told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fusiond.assembly.assembly import Assembly, load
from fusiond.demo.injecting import Injected, inject_into, measured_of
from fusiond.engine.records import HAS_R
from fusiond.errors import ConfigError
from fusiond.recording.log import open_log
from fusiond.simulation.faults import parse_faults
from fusiond.simulation.logs import write_log
from fusiond.simulation.registry import simulate
from fusiond.simulation.rig import minicar
from fusiond.types import TICK
from tools import simulate as tool

PROJECT = Path(__file__).resolve().parents[2]
EVERY_KIND = [
    "ultrasonic.delay=0.1@0.5", "ultrasonic.0.noise=4@1", "ultrasonic.intermittent=0.5@1.5",
    "accelerometer.scale=1.1@0",
    "accelerometer.drift=0.5@0.7+1", "accelerometer.stuck@1+0.3", "accelerometer.nan@1.5+0.01",
    "accelerometer.spike=5@1.7", "ultrasonic.bias=1@0+0.2", "ultrasonic.broken@1.9",
]  # fmt: skip


@pytest.fixture(scope="module")
def assembly() -> Assembly:
    return load(PROJECT / "configs" / "minicar.toml")


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("log") / "log.csv"
    write_log(path, simulate("minicar", duration_s=2.0))
    return path


def cut(readings, sizes):
    """The same readings in chunks of these sizes, over and over."""
    at, k = 0, 0
    while at < len(readings):
        yield readings[at : at + sizes[k % len(sizes)]]
        at, k = at + sizes[k % len(sizes)], k + 1


def whole(chunks):
    return np.concatenate([chunk.copy() for chunk in chunks])


def test_what_a_configuration_says_of_its_sensors(assembly):
    sensors = {sensor.name: sensor for sensor in measured_of(assembly)}
    assert sensors["ultrasonic"].sigma == (0.01,)
    assert sensors["ultrasonic"].names == ("position_m",)
    assert [sensor.name for sensor in measured_of(assembly)] == [s.name for s in assembly.layout.sensors]
    planar = {one.name: one for one in measured_of(load(PROJECT / "configs" / "ground_vehicle.toml"))}
    assert planar["magnetometer"].angles == {0}
    assert planar["gps"].angles == {1}, "course over ground"


def test_only_what_a_fault_meets_is_changed_and_the_log_itself_is_not(assembly, log):
    readings = whole(open_log(log, assembly.layout))
    before = readings.tobytes()
    lies = whole(inject_into([readings], assembly, ["ultrasonic.bias=0.5@0.5+0.5"], 0))
    number = assembly.layout.numbers["ultrasonic"]
    met = (readings["sensor"] == number) & (readings["t_ns"] >= 5 * 10**8) & (readings["t_ns"] < 10**9)
    assert met.sum() == 17
    assert lies[~met].tobytes() == readings[~met].tobytes()
    assert np.array_equal(lies["z"][met, 0], readings["z"][met, 0] + 0.5)
    assert readings.tobytes() == before
    readings["z"][met, 0] += 0.5
    assert lies.tobytes() == readings.tobytes()


def test_a_fault_of_no_size_gives_the_logs_own_bytes(assembly, log):
    readings = whole(open_log(log, assembly.layout))
    nothing = ["ultrasonic.bias=0@0", "accelerometer.noise=1@0", "accelerometer.delay=0@0"]
    assert whole(inject_into([readings], assembly, nothing, 0)).tobytes() == readings.tobytes()


def test_chunks_of_any_size_give_the_same_bytes(assembly, log):
    """Every kind at once; twice over the same object too. Another seed gives others."""
    readings = whole(open_log(log, assembly.layout))
    sensors, faults = measured_of(assembly), parse_faults(EVERY_KIND)
    once = Injected([readings], sensors, faults, 5)
    expected = whole(once)
    assert len(expected) < len(readings)
    assert whole(once).tobytes() == expected.tobytes()
    assert once.warnings == []
    for sizes in ([1], [7, 1, 300]):
        pieces = list(cut(readings, sizes))
        assert whole(Injected(pieces, sensors, faults, 5)).tobytes() == expected.tobytes()
    assert whole(Injected([readings], sensors, faults, 6)).tobytes() != expected.tobytes()


def test_a_simulated_sensor_tells_the_lies_a_log_would_have(assembly, log, tmp_path):
    """Inside the sensors or on the log of honest ones: the same bytes, every kind at once."""
    path = tmp_path / "lying.csv"
    write_log(path, simulate("minicar", duration_s=2.0, seed=0, inject=EVERY_KIND))
    inside = whole(open_log(path, assembly.layout))
    assert (
        inside.tobytes()
        == whole(inject_into(open_log(log, assembly.layout), assembly, EVERY_KIND, 0)).tobytes()
    )


def test_a_lie_is_felt_by_a_loop_that_is_closed_over_it():
    """With feedback from the ultrasonic sensor, half a metre too much stops the car half a metre short."""
    end_m = [
        simulate("minicar", duration_s=20.0, feedback="ultrasonic", inject=inject).truth.column("position")[
            -1
        ]
        for inject in ([], ["ultrasonic.bias=0.5@0"])
    ]
    assert end_m[0] == pytest.approx(2.0, abs=0.05)
    assert end_m[1] == pytest.approx(1.5, abs=0.05)


@pytest.mark.parametrize(
    "system", ["birotor", "wall_robot", "reference_plant", "constant_velocity", "planar"]
)
def test_every_simulated_system_can_lie_and_is_honest_without(system):
    honest = simulate(system, duration_s=3.0)
    sensor = honest.readings[-1].sensor
    lying = simulate(system, duration_s=3.0, inject=[f"{sensor}.0.bias=1@0"])
    assert len(lying.readings) == len(honest.readings)
    for before, after in zip(honest.readings, lying.readings, strict=True):
        if before.sensor != sensor:
            assert after == before
        elif sensor != "heading":
            assert after.z == (before.z[0] + 1.0, *before.z[1:])


def test_events_pass_and_no_chunk_is_empty(assembly):
    """A sensor broken from the beginning leaves the ticks; START counts from the first reading, not from them."""
    readings = np.zeros(6, assembly.layout.reading)
    number = assembly.layout.numbers["ultrasonic"]
    readings["sensor"] = [TICK, number, number, TICK, number, number]
    readings["t_ns"] = [0, 10**9, 2 * 10**9, 2 * 10**9, 3 * 10**9, 4 * 10**9]
    readings["length"] = 1
    chunks = [readings[:1], readings[1:3], readings[3:]]
    kept = list(inject_into(chunks, assembly, ["ultrasonic.broken@0"], 0))
    assert [chunk["sensor"].tolist() for chunk in kept] == [[TICK], [TICK]]
    later = whole(inject_into(chunks, assembly, ["ultrasonic.bias=1@1+1"], 0))
    assert later["z"][:, 0].tolist() == [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]


def test_a_reading_of_the_wrong_length_has_no_more_numbers_than_before():
    assembly = load(PROJECT / "configs" / "ground_vehicle.toml")
    readings = np.zeros(2, assembly.layout.reading)
    readings["sensor"] = assembly.layout.numbers["gps"]
    readings["length"] = [2, 1]
    lies = whole(inject_into([readings], assembly, ["gps.bias=1@0"], 0))
    assert lies["z"][:, :2].tolist() == [[1.0, 1.0], [1.0, 0.0]]


def test_noise_goes_by_the_covariance_a_reading_brings(assembly):
    """Readings with R = 1 get a hundred times the noise of those without (sigma 0.01)."""
    readings = np.zeros(2000, assembly.layout.reading)
    readings["sensor"], readings["length"] = assembly.layout.numbers["ultrasonic"], 1
    readings["t_ns"] = np.arange(2000) * 10**7
    readings["flags"][1000:] = HAS_R
    readings["R"][1000:, 0, 0] = 1.0
    added = whole(inject_into([readings], assembly, ["ultrasonic.noise=2@0"], 0))["z"][:, 0]
    limits = {"rel": 4.0 / np.sqrt(2000.0)}
    assert added[:1000].std() == pytest.approx(np.sqrt(3.0) * 0.01, **limits)
    assert added[1000:].std() == pytest.approx(np.sqrt(3.0), **limits)


def test_a_fault_outside_the_log_is_told(assembly, log):
    lies = inject_into(open_log(log, assembly.layout), assembly, ["ultrasonic.bias=1@60"], 0)
    whole(lies)
    assert lies.warnings == [
        "inject ultrasonic.bias=1@60: met no reading; compare it with the times of the log"
    ]


def test_a_sensor_nobody_has_is_the_operators_mistake(assembly):
    with pytest.raises(ConfigError, match="no sensor `ultrasonc`; did you mean `ultrasonic`"):
        inject_into([], assembly, ["ultrasonc.bias=1@0"], 0)


def test_the_tool_writes_a_log_that_lies(tmp_path, capsys):
    arguments = ["wall_robot", "--for", "2", "--out", str(tmp_path / "log.csv")]
    assert tool.main([*arguments, "--inject", "range.broken@1"]) == 0
    assert "'range': 10, 'speed': 21" in capsys.readouterr().out
    assert tool.main([*arguments, "--inject", "rnge.broken@1"]) == 2
    assert "did you mean `range`?" in capsys.readouterr().err


def test_a_rig_that_was_told_to_lie_does():
    rig = minicar(0)
    assert {sensor.name for sensor in rig.measured} == {"accelerometer", "ultrasonic", "applied", "reference"}
    assert rig.tell(rig.begin())[0].sensor == "ultrasonic"
