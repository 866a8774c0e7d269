"""Simulated logs: arrival order, exact decimals, and the tool that writes them."""

from __future__ import annotations

import csv
import json
from decimal import Decimal
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusiond.simulation.logs import decimal_seconds, log_lines, write_log, write_truth
from fusiond.simulation.registry import simulate
from tools import simulate as tool


@given(st.integers(-(2**63), 2**63 - 1))
def test_stamps_are_written_as_exact_decimals(t_ns: int) -> None:
    text = decimal_seconds(t_ns)
    assert Decimal(text) * 1_000_000_000 == t_ns
    assert "e" not in text.lower()
    assert "." in text


def test_readings_arrive_within_their_delay_and_jitter_and_stay_what_they_were() -> None:
    """Arrival - stamp fills [delay, delay + jitter]; arrivals never go back, stamps do; no value changes."""
    run = simulate("planar", 0, 20.0, delay_s={"gps": 0.3}, jitter_s={"gps": 0.1, "gyro": 0.05})
    late_s: dict[str, list[float]] = {name: [] for name in ("gps", "gyro", "radar")}
    for reading, arrival_ns in zip(run.readings, run.arrivals_ns.tolist(), strict=True):
        if reading.sensor in late_s:
            late_s[reading.sensor].append((arrival_ns - reading.t_ns) / 1e9)
    assert 0.3 <= min(late_s["gps"]) < 0.31
    assert 0.39 < max(late_s["gps"]) <= 0.4
    assert 0.0 <= min(late_s["gyro"]) < 0.001
    assert 0.049 < max(late_s["gyro"]) <= 0.05
    assert set(late_s["radar"]) == {0.0}
    assert np.all(np.diff(run.arrivals_ns) >= 0)
    stamps = [reading.t_ns for reading in run.readings]
    assert any(later < earlier for earlier, later in pairwise(stamps))
    assert sorted(run.readings) == sorted(simulate("planar", 0, 20.0).readings)


def test_equal_arrivals_keep_the_order_of_stamps_then_names() -> None:
    """A delay of 0.1 s makes 10 Hz sensors arrive together, 21 times over."""
    run = simulate("planar", 0, 2.0, delay_s={"radar": 0.1, "gps": 0.1})
    order = [(a, r.t_ns, r.sensor) for a, r in zip(run.arrivals_ns.tolist(), run.readings, strict=True)]
    assert order == sorted(order)
    assert order.index((200_000_000, 100_000_000, "radar")) < order.index(
        (200_000_000, 200_000_000, "beacon")
    )


def test_without_delays_readings_come_by_stamp_then_name() -> None:
    run = simulate("planar", 0, 2.0)
    order = [(reading.t_ns, reading.sensor) for reading in run.readings]
    assert order == sorted(order)
    assert run.arrivals_ns.tolist() == [t_ns for t_ns, _ in order]


@pytest.mark.parametrize("jitter_s", [0.0, 0.2])
def test_a_log_reads_back_to_the_same_readings(tmp_path: Path, jitter_s: float) -> None:
    """Every stamp, value and arrival; `arrival_s` only where something is late."""
    run = simulate("planar", 3, 3.0, jitter_s=jitter_s)
    write_log(tmp_path / "log.csv", run)
    rows = list(csv.reader((tmp_path / "log.csv").read_text().splitlines()))
    late = ["arrival_s"] if jitter_s else []
    assert rows[0] == ["t_s", "sensor", *late, "z0", "z1", "z2"]
    back = [
        (int(Decimal(t) * 10**9), name, tuple(map(float, rest[len(late) :]))) for t, name, *rest in rows[1:]
    ]
    assert back == list(run.readings)
    if late:
        assert [int(Decimal(row[2]) * 10**9) for row in rows[1:]] == run.arrivals_ns.tolist()


def test_a_truth_reads_back_to_the_same_table(tmp_path: Path) -> None:
    truth = simulate("minicar", 0, 0.5).truth
    write_truth(tmp_path / "truth.csv", truth)
    rows = list(csv.reader((tmp_path / "truth.csv").read_text().splitlines()))
    assert rows[0] == ["t_s", "position", "velocity", "acceleration_bias", "acceleration", "force"]
    np.testing.assert_array_equal(np.array([row[1:] for row in rows[1:]], dtype=float), truth.values)
    assert [int(Decimal(row[0]) * 10**9) for row in rows[1:]] == truth.t_ns.tolist()


def test_truth_is_interpolated_and_never_extrapolated() -> None:
    truth = simulate("wall_robot").truth
    between = truth.at(150_000_000)
    assert between["position"] == pytest.approx(truth.column("position")[1:3].mean())
    with pytest.raises(ValueError, match="outside the truth"):
        truth.at(10_000_000_001)
    with pytest.raises(KeyError, match="there are position, velocity"):
        truth.column("speed")


def test_the_tool_writes_log_and_truth(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`--json` prints one object that counts what the log holds; options and delays reach the simulation."""
    log, truth = tmp_path / "log.csv", tmp_path / "truth.csv"
    arguments = ["constant_velocity", "--seed", "4", "--for", "2", "--out", str(log), "--truth", str(truth)]
    more = ["--set", "R=[0.01, 4]", "--set", "q=0", "--delay", "y2=0.25", "--json"]
    assert tool.main([*arguments, *more]) == 0
    written = json.loads(capsys.readouterr().out)
    assert written["sensors"] == {"y1": 21, "y2": 21}
    asked = simulate("constant_velocity", 4, 2.0, R=(0.01, 4.0), q=0.0, delay_s={"y2": 0.25})
    assert log.read_text().splitlines() == list(log_lines(asked))
    assert len(truth.read_text().splitlines()) == 22


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["minicat"], "choose one of minicar"),
        (["minicar", "--set", "feedback"], "write NAME=VALUE"),
        (["minicar", "--set", "seed=3"], "use NAME, --seed"),
        (["minicar", "--delay", "ultrasonic=soon"], "give seconds"),
        (["minicar", "--for", "-1"], "not above 0"),
    ],
)
def test_the_tool_names_an_operators_mistake(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], says: str
) -> None:
    """Exit 2, the remedy on stderr, no file left behind."""
    assert tool.main([*arguments, "--out", str(tmp_path / "log.csv")]) == 2
    assert says in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_the_tool_fails_where_it_cannot_write(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert tool.main(["wall_robot", "--out", str(tmp_path / "absent" / "log.csv")]) == 1
    assert "absent" in capsys.readouterr().err
