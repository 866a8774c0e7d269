"""Faults under topologies that have no monitors of their own: the compiled engine beside them judges."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.demo.injecting import inject_into
from fusiond.engine.noise_learnt import learnt, recall
from fusiond.errors import ConfigError
from fusiond.simulation.registry import simulate
from fusiond.types import Health, Kind, Verdict
from tools.pages.trials import configured, records

FAULTS = {"mean_time_between_false_alarms_s": 36000.0}
TOPOLOGIES = ("federated", "covariance_intersection", "seed_averaged", "stacked")
ONSET_S, END_S = 40, 90


@pytest.fixture(scope="module")
def overseen():
    """One assembly for each topology, watched."""
    return {
        topology: configured("reference_plant", {"fusion": {"topology": topology}, "faults": FAULTS})
        for topology in TOPOLOGIES
    }


def told(assembly, *faults):
    """Readings of a simulated run in order of time, with the faults in them."""
    given = records(assembly.layout, simulate("reference_plant", 3, float(END_S)).readings)
    given = given[np.lexsort((given["sensor"], given["t_ns"]))]
    return np.concatenate(list(inject_into([given], assembly, faults, 0)))


@pytest.mark.parametrize("topology", TOPOLOGIES)
def test_a_biased_sensor_leaves_the_state_of_a_run_that_lost_it_at_the_onset(overseen, topology):
    """A bias of 6 sigma is named; from then on state and std are, in bytes, those without y1 since the onset."""
    # GIVEN a watched topology; WHEN y1 is off by 6 sigma from t = 40 s to the end
    assembly = overseen[topology]
    engine, y1 = assembly.engine(), assembly.layout.numbers["y1"]
    readings = told(assembly, f"y1.bias=6@{ONSET_S}")
    reports = engine.process(readings).copy()

    # THEN y1 alone is excluded, within 5 readings of each sensor
    found = np.flatnonzero(reports["health"][:, y1] == Health.EXCLUDED)
    assert reports["t_ns"][found[0]] <= (ONSET_S + 5) * 10**9
    assert reports["fault"][-1, y1] == Kind.BIAS
    assert np.all(reports["health"][:, [k for k in range(3) if k != y1]] == Health.HEALTHY)
    assert abs(reports["fault_size"][-1, y1] - 6.0) < 4.0 * reports["fault_std"][-1, y1]

    # AND the estimate is that of an unwatched engine that never got y1's readings from the onset it was given
    onset_ns = reports["fault_onset_ns"][-1, y1]
    without = configured("reference_plant", {"fusion": {"topology": topology}}).engine()
    kept = (readings["sensor"] != y1) | (readings["t_ns"] < onset_ns)
    expected = without.process(readings[kept])
    assert np.array_equal(reports["x"][-1], expected["x"][-1])
    assert np.array_equal(reports["std"][-1], expected["std"][-1])


def test_a_single_spike_is_gated_and_moves_no_flag(overseen):
    """One reading 12 sigma off is refused by name in every topology, and no sensor is blamed."""
    for assembly in overseen.values():
        reports = assembly.engine().process(told(assembly, f"y2.spike=12@{ONSET_S}"))
        refused = reports["verdict"] == Verdict.GATED
        assert list(reports["t_ns"][refused]) == [ONSET_S * 10**9]
        assert np.all(reports["health"] == Health.HEALTHY)


def test_a_broken_node_is_silent_and_the_others_go_on(overseen):
    """A sensor that stops is called silent; nothing of the others is refused."""
    assembly = overseen["federated"]
    y1 = assembly.layout.numbers["y1"]
    reports = assembly.engine().process(told(assembly, f"y1.broken@{ONSET_S}"))
    assert reports["health"][-1, y1] == Health.SILENT
    assert np.all(reports["verdict"] == Verdict.USED)


def test_readings_one_at_a_time_give_the_bits_of_a_batch(overseen):
    """However the readings are handed over, reports and records end the same."""
    assembly = overseen["covariance_intersection"]
    readings = told(assembly, f"y1.drift=0.5@{ONSET_S}")
    batch, single = assembly.engine(), assembly.engine()
    together = batch.process(readings).copy()
    apart = np.concatenate([single.process(readings[k : k + 1]).copy() for k in range(len(readings))])
    assert together.tobytes() == apart.tobytes()
    assert batch.state_sha256() == single.state_sha256()
    single.reset()
    assert single.process(readings).tobytes() == together.tobytes()


def test_an_input_that_must_be_done_without_needs_the_compiled_step():
    """What a plain step could not do is refused at start, with the remedy."""
    changes = {
        "fusion": {"topology": "federated"}, "faults": FAULTS,
        "sensor": {"applied": {"without_input_std": {"u": 1.0}}},
    }  # fmt: skip
    with pytest.raises(ConfigError, match="only the compiled step can do without an input"):
        configured("reference_plant", changes)


def noisy(topology):
    """An engine of the topology, watched and with its noise estimated, and the number of y1."""
    changes = {"fusion": {"topology": topology}, "faults": FAULTS, "adaptation": {"method": "variational"}}
    assembly = configured("reference_plant", changes)
    return assembly, assembly.engine(), assembly.layout.numbers["y1"]


@pytest.mark.parametrize("topology", ["federated", "stacked"])
def test_the_noise_of_a_suspect_stands_still_in_the_topology_too(topology):
    """While the judge seeks an error in y1, what y1 says widens no R, and the other sensors' are estimated on."""
    # GIVEN noise that is estimated; WHEN y1 is off by 3 sigma, found at once but sought for a while
    assembly, engine, y1 = noisy(topology)
    readings, still = told(assembly, f"y1.bias=3@{ONSET_S}"), 0
    for k in range(len(readings)):
        before = engine.track[0]["noise"]["trusted"][:, y1].copy()
        engine.process(readings[k : k + 1])
        frozen = engine.judging.track[0]["noise"]["frozen"]

        # THEN both engines hold the same sensors' noise, and y1's is as it was
        assert np.array_equal(engine.track[0]["noise"]["frozen"], frozen)
        if frozen[y1] and readings["sensor"][k] == y1:
            assert np.array_equal(engine.track[0]["noise"]["trusted"][:, y1], before)
            still += 1
    assert still > 0


def test_who_judges_begins_with_the_noise_known_from_before():
    """After a restart the judge holds noise four times as large as declared for what it always was."""
    assembly, engine, y1 = noisy("federated")
    known = {"y1": {"trusted": [4.0], "slow": [4.0]}}
    recall(engine, known)
    engine.process(told(assembly)[:2])
    assert engine.judging.track[0]["noise"]["slow"][y1, 0] == pytest.approx(4.0, rel=0.1)
    assert learnt(engine)["y1"]["slow"] == [engine.judging.track[0]["noise"]["slow"][y1, 0]]
