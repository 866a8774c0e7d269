"""Chaos in short: the laws hold on a few trials, and each law can be broken."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from fusiond.simulation.faults import parse_faults
from fusiond.simulation.registry import simulate
from fusiond.types import Health, ServiceHealth
from tools.chaos.__main__ import main, trial
from tools.chaos.laws import astray, broken_laws, ill_at_the_end, slandered
from tools.chaos.mischief import DISORDERS, drawn
from tools.chaos.systems import SYSTEMS, rig


@pytest.fixture(scope="module")
def calm():
    """A run of three sensors without any mischief: rig, simulation, reports."""
    here, system = rig("three_positions"), SYSTEMS["three_positions"]
    simulation = simulate(system.simulated, 3, 30.0, **system.options)
    here.engine.reset()
    return here, simulation, here.engine.process(here.log(simulation)).copy()


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("name", ["three_positions", "minicar"])
def test_no_law_is_broken(name, seed):
    assert trial(name, seed).findings.broken == ()


def test_a_trial_is_the_same_twice():
    assert trial("three_positions", 5) == trial("three_positions", 5)


def test_mischief_is_of_every_kind_and_over_in_time():
    sigma = {"a": 0.1, "b": 2.0, "c": 1.0}
    all_of_it = [drawn(np.random.default_rng(seed), sigma, 100.0) for seed in range(200)]
    assert {fault.kind for one in all_of_it for fault in one.faults} == {
        fault.kind for text in KINDS for fault in parse_faults([text])
    }
    assert {one.disorder for one in all_of_it} == set(DISORDERS)
    assert max(fault.end_ns for one in all_of_it for fault in one.faults) <= 60e9
    for one in all_of_it:
        assert parse_faults([str(fault) for fault in one.faults]) == one.faults


KINDS = [f"a.{kind}@1+1" for kind in ("broken", "stuck", "nan")] + [
    f"a.{kind}=0.5@1+1" for kind in ("bias", "drift", "spike", "scale", "delay", "intermittent")
] + ["a.noise=2@1+1"]  # fmt: skip


def test_a_calm_run_breaks_no_law_and_leaves_nothing_to_say(calm):
    here, simulation, reports = calm
    layout = here.assembly.layout
    assert broken_laws(reports, len(reports), "a", "a") == ()
    assert ill_at_the_end(layout, reports) == ()
    assert slandered(layout, reports, set()) == ()
    assert astray(layout, reports, simulation) == ()


def test_each_law_can_be_broken(calm):
    _, _, reports = calm
    mad = reports.copy()
    mad["x"][5, 0] = np.nan
    assert broken_laws(mad, len(mad), "a", "a") == ("a number that is none in an estimate",)
    mad["service"][5] = ServiceHealth.INVALID
    assert broken_laws(mad, len(mad), "a", "a") == ()
    assert broken_laws(reports, len(reports) + 1, "a", "a") == ("a reading without a verdict",)
    unnamed = reports.copy()
    unnamed["verdict"][7] = 77
    assert broken_laws(unnamed, len(unnamed), "a", "a") == ("a reading without a verdict",)
    assert broken_laws(reports, len(reports), "a", "b") == ("other bits for the same readings",)


def test_what_is_counted_is_seen(calm):
    here, simulation, reports = calm
    layout, worse = here.assembly.layout, copy.deepcopy(reports)
    y2 = layout.numbers["y2"]
    worse["health"][-1, y2] = Health.EXCLUDED
    assert ill_at_the_end(layout, worse) == ("y2 excluded",)
    assert slandered(layout, worse, {"y1"}) == ("y2",)
    assert slandered(layout, worse, {"y2"}) == ()
    worse["x"][-1, 0] += 7.0 * worse["std"][-1, 0]
    worse["service"][-1] = ServiceHealth.NOMINAL
    assert any(found.startswith("position off by") for found in astray(layout, worse, simulation))
    worse["service"][-1] = ServiceHealth.DEGRADED
    assert astray(layout, worse, simulation) == ()


def test_the_command_prints_a_table_and_ends_well(capsys):
    assert main(["--only", "three_positions", "--trials", "2", "--processes", "1"]) == 0
    assert "| three_positions | 2 | 0 |" in capsys.readouterr().out
