"""What a run's reports say was wrong becomes a list: found once, revised, cleared, however the run is cut."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fusiond.assembly.assembly import load
from fusiond.recording.fault_log import MOST, FaultLog
from fusiond.recording.fault_words import fault_object, fault_text
from fusiond.types import Kind, Verdict

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
S = 1_000_000_000


@pytest.fixture(scope="module")
def layout():
    return load(CONFIGS / "minicar.toml").layout


@pytest.fixture
def reports(layout):
    """A hundred reports, one a second, from 1 s on, in which nothing is wrong."""
    reports = np.zeros(100, layout.report)
    reports["t_ns"] = reports["state_t_ns"] = np.arange(1, 101) * S
    return reports


def wrong(reports, rows, kind, *, number=1, onset_s=0.0, size=0.0, std=0.0, channel=0, suspects=0):
    """Say in these rows that a sensor has a fault."""
    said = {
        "fault": kind, "fault_onset_ns": round(onset_s * S), "fault_size": size, "fault_std": std,
        "fault_channel": channel, "suspects": suspects,
    }  # fmt: skip
    for field, value in said.items():
        reports[field][rows, number] = value


def found(layout, *blocks):
    log = FaultLog(layout)
    for block in blocks:
        log.add(block)
    return log


def test_a_fault_is_listed_from_its_detection_until_it_is_cleared(layout, reports):
    number = layout.numbers["ultrasonic"]
    wrong(reports, slice(9, 29), Kind.BIAS, number=number, onset_s=8.5, size=0.5, std=0.01)
    assert found(layout, reports).faults(number) == (
        {
            "kind": "bias", "channel": 0, "onset_s": 8.5, "size": 0.5, "size_std": 0.01, "unit": "m",
            "ambiguous_with": [], "detected_s": 10.0, "cleared_s": 30.0,
        },
    )  # fmt: skip
    assert found(layout, reports[:20]).faults(number)[0]["cleared_s"] is None


@pytest.mark.parametrize("cuts", [[1], [9], [10], [20, 29], list(range(1, 100))])
def test_how_a_run_is_cut_into_blocks_changes_nothing(layout, reports, cuts):
    number = layout.numbers["ultrasonic"]
    wrong(reports, slice(9, 29), Kind.BIAS, number=number, onset_s=8.5, size=0.5)
    wrong(reports, slice(40, 60), Kind.STUCK, number=number, onset_s=40.0, channel=-1)
    reports["model"][70:75] = 1
    whole, cut = found(layout, reports), found(layout, *np.split(reports, cuts))
    assert cut.faults(number) == whole.faults(number)
    assert cut.alarms() == whole.alarms() == [{"detected_s": 71.0, "cleared_s": 76.0}]
    assert [fault["kind"] for fault in whole.faults(number)] == ["bias", "stuck"]
    assert whole.faults(number)[1]["channel"] is None


def test_a_decision_about_the_same_onset_revises_and_a_later_onset_is_another_fault(layout, reports):
    """A bias turns out to be a drift: one fault, found when it was found. A jump on top of it is a second one."""
    number = layout.numbers["ultrasonic"]
    wrong(reports, slice(9, 14), Kind.BIAS, number=number, onset_s=8.0, size=0.5)
    wrong(reports, slice(14, 50), Kind.DRIFT, number=number, onset_s=7.0, size=0.1)
    wrong(reports, slice(50, 60), Kind.BIAS, number=number, onset_s=48.0, size=3.0)
    faults = found(layout, reports).faults(number)
    assert [(f["kind"], f["detected_s"], f["cleared_s"], f["unit"]) for f in faults] == [
        ("drift", 10.0, 51.0, "m/s"),
        ("bias", 51.0, 61.0, "m"),
    ]
    assert faults[0]["onset_s"] == 7.0


def test_a_silence_stands_beside_what_was_known_when_it_began(layout, reports):
    number = layout.numbers["ultrasonic"]
    wrong(reports, slice(9, 80), Kind.BIAS, number=number, onset_s=8.0, size=0.5)
    wrong(reports, slice(30, 40), Kind.SILENT, number=number, onset_s=28.0, channel=-1)
    faults = found(layout, reports).faults(number)
    assert [(f["kind"], f["onset_s"], f["detected_s"], f["cleared_s"]) for f in faults] == [
        ("bias", 8.0, 10.0, 81.0),
        ("silent", 28.0, 31.0, 41.0),
    ]


def test_an_ambiguous_fault_names_the_others(layout, reports):
    one, other = layout.numbers["ultrasonic"], layout.numbers["accelerometer"]
    wrong(reports, slice(9, 20), Kind.BIAS, number=one, onset_s=8.0, size=-0.5, std=0.1, suspects=1 << other)
    fault = fault_object(layout, reports[10], one)
    assert fault["ambiguous_with"] == ["accelerometer"]
    assert fault_text(fault) == "bias -0.5 +-0.1 m since 8.000 s; it may as well be accelerometer"
    assert fault_object(layout, reports[10], other) is None


def test_a_late_reading_and_a_wrong_stamp_do_not_date_a_detection(layout, reports):
    """Found with a reading two seconds late, or one stamped in the next century: found now."""
    number = layout.numbers["ultrasonic"]
    wrong(reports, slice(9, 20), Kind.GARBAGE, number=number, onset_s=8.0, channel=-1)
    reports["t_ns"][9] -= 2 * S
    assert found(layout, reports).faults(number)[0]["detected_s"] == 10.0
    reports["t_ns"][9], reports["verdict"][9] = 10**18, Verdict.FROM_FUTURE
    assert found(layout, reports).faults(number)[0]["detected_s"] == 10.0


def test_memory_does_not_grow_with_the_run(layout):
    number = layout.numbers["ultrasonic"]
    reports = np.zeros(4 * MOST, layout.report)
    reports["t_ns"] = reports["state_t_ns"] = np.arange(1, len(reports) + 1) * S
    wrong(reports, slice(0, None, 2), Kind.SILENT, number=number, channel=-1)
    faults = found(layout, reports).faults(number)
    assert len(faults) == MOST
    assert faults[-1]["cleared_s"] == 4.0 * MOST
