"""The smoother against one large conditioned Gaussian, and against Rauch, Tung and Striebel as printed."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.engine.records import HAS_ARRIVAL
from fusiond.errors import ConfigError, LogError
from fusiond.filters.smoother import before_channel, end, smoothed
from fusiond.recording.smoothing_tape import Tape
from fusiond.simulation.registry import simulate
from tests.laws.engine_rig import INPUT_STD, MS, SECOND, STD, A, B, G, H, Q, assembled, stream, tick, toml_of
from tests.laws.smoothing_rig import Linear, Seen, batch, reset, rts
from tools.pages.smoothing import smoothed_run
from tools.pages.trials import configured, records

MODEL = Linear(np.array(A), np.array(B), np.array(G) @ np.array(Q) @ np.array(G).T)
START, START_P = np.zeros(2), np.diag([4.0, 1.0])


def as_seen(layout, readings):
    """The rig's readings for the batch, in the order in which the engine takes them."""
    out = []
    for record in readings[np.lexsort((readings["z"][:, 0], readings["sensor"], readings["t_ns"]))]:
        name = layout.sensors[record["sensor"]].name
        z = record["z"][: record["length"]].copy()
        if name == "drive":
            out.append(Seen(int(record["t_ns"]), None, z, None))
        else:
            out.append(Seen(int(record["t_ns"]), np.array(H[name]), z, np.diag(STD[name]) ** 2))
    return out


def close(run, expected, part=slice(None)):
    x, P = expected
    assert run.states["x"][part] == pytest.approx(x, rel=1e-9, abs=1e-9)
    assert run.states["P"][part] == pytest.approx(P, rel=1e-9, abs=1e-9)


def test_smoothed_is_the_batch_solution():
    """160 asynchronous readings of an input and three sensors: states and covariances to 1e-9."""
    assembly = assembled(toml_of())
    readings = stream(assembly.layout, 160, seed=3)
    run = smoothed_run(assembly, readings)
    assert run.followed
    assert run.segments == 1
    close(run, batch(MODEL, START, START_P, INPUT_STD**2, as_seen(assembly.layout, readings)))


def test_the_last_state_is_the_filters_and_no_other_is_less_certain():
    assembly = assembled(toml_of())
    run = smoothed_run(assembly, stream(assembly.layout, 160, seed=3))
    assert np.array_equal(run.states["x"][-1], run.filtered["x"][-1])
    U = np.triu(run.filtered["U"], 1) + np.eye(2)
    P = (U * run.filtered["d"][:, None, :]) @ np.swapaxes(U, 1, 2)
    assert np.linalg.eigvalsh(P - run.states["P"]).min() > -1e-15
    assert np.linalg.eigvalsh(run.states["P"]).min() >= 0.0


@pytest.mark.parametrize("chunk", [1, 7, 1000])
def test_late_readings_and_ticks_change_nothing(chunk):
    """Readings up to 40 ms late and a tick after each: the smoothed run of the same readings in order."""
    assembly = assembled(toml_of())
    in_order = stream(assembly.layout, 160, seed=4, distinct=True)
    expected = smoothed_run(assembly, in_order)
    rng = np.random.default_rng(0)
    arrival = in_order["t_ns"] + rng.integers(0, 40 * MS, len(in_order))
    arrival[0] = in_order["t_ns"][0]
    late = in_order[np.argsort(arrival, kind="stable")]
    assert np.any(np.diff(late["t_ns"]) < 0)
    ticked = [part for row in late for part in (row.reshape(1), tick(assembly.layout, int(row["t_ns"]) + MS))]
    run = smoothed_run(assembly, np.concatenate(ticked), chunk)
    assert run.followed
    assert np.array_equal(run.states, expected.states)


def test_a_reset_parts_the_run_in_two():
    """Each part is the batch solution of its own readings from the configured start."""
    assembly = assembled(toml_of())
    layout = assembly.layout
    readings = stream(layout, 120, seed=5, distinct=True)
    first, second = readings[:60], readings[60:]
    at_ns = int(first["t_ns"][-1])
    run = smoothed_run(assembly, np.concatenate([first, reset(layout, at_ns), second]))
    assert run.followed
    assert run.segments == 2
    # A reset keeps the inputs that are held; the batch is told them by a reading of its own.
    held = first[first["sensor"] == layout.numbers["drive"]][-1:].copy()
    held["t_ns"] = second["t_ns"][0]
    seen = as_seen(layout, np.concatenate([held, second]))
    count = sum(s.H is not None for s in as_seen(layout, first))
    close(run, batch(MODEL, START, START_P, INPUT_STD**2, as_seen(layout, first)), slice(0, count))
    close(run, batch(MODEL, START, START_P, INPUT_STD**2, seen), slice(count, None))


def test_a_clock_that_steps_does_not_part_the_run():
    """All stamps jump back by an hour, believed after 2 s: the states of both sides are smoothed together."""
    assembly = assembled(toml_of(sections="[history]\nresync_count = 5"))
    readings = stream(assembly.layout, 1200, seed=6, distinct=True)
    readings["arrival_ns"], readings["flags"] = readings["t_ns"], readings["flags"] | HAS_ARRIVAL
    stepped = readings.copy()
    stepped["t_ns"][600:] -= 3600 * SECOND
    run = smoothed_run(assembly, stepped)
    assert run.followed
    assert run.segments == 1
    (before,) = np.flatnonzero(np.diff(run.states["state_t_ns"]) < 0)
    U = np.triu(run.filtered["U"][before], 1) + np.eye(2)
    filtered = (U * run.filtered["d"][before]) @ U.T
    assert np.trace(run.states["P"][before]) < 0.99 * np.trace(filtered)


def test_singular_covariances_and_perfect_readings_need_no_care():
    """A start known exactly, noise in one direction only, a sensor without noise: P- is singular again and again."""
    text = toml_of(
        model={"G": [[0.0], [1.0]], "Q": [[0.3]]},
        sensors={"c": {"noise_std": "{ z0 = 0.0 }"}},
        sections="",
    ).replace("{ position = 2.0, velocity = 1.0 }", "{ position = 0.0, velocity = 0.0 }")
    assembly = assembled(text)
    readings = stream(assembly.layout, 90, seed=7, distinct=True)
    run = smoothed_run(assembly, readings)
    model = Linear(np.array(A), np.array(B), np.diag([0.0, 0.3]))
    seen = as_seen(assembly.layout, readings)
    for one in seen:
        if one.H is not None and one.H.shape == (1, 2):
            one.R = np.zeros((1, 1))
    assert run.followed
    x, P = batch(model, START, np.zeros((2, 2)), INPUT_STD**2, seen)
    assert run.states["x"] == pytest.approx(x, rel=1e-7, abs=1e-7)
    assert run.states["P"] == pytest.approx(P, rel=1e-7, abs=1e-9)


def test_a_channel_without_variance_changes_nothing():
    after = end(3)
    assert before_channel(after, np.ones(3), np.zeros(3), 0.0, 0.0) is after


def test_rounding_leaves_no_covariance_indefinite():
    """An adjoint so large that I - L' A L has negative eigenvalues by rounding: zero variance, not less."""
    U, d = np.eye(2)[None], np.array([[1.0, 1e-12]])
    _, P = smoothed(U, d, np.zeros((1, 2)), np.diag([1.0 + 1e-9, 0.0])[None])
    assert np.linalg.eigvalsh(P[0]).min() >= 0.0


def test_of_an_extended_filter_it_is_that_of_rauch_tung_and_striebel():
    """A vehicle in the plane with six sensors, angles on the circle: states to 1e-6 of their deviation."""
    assembly = configured("planar", {"filter": {"leave_one_out": False, "local_filters": False}})
    simulation = simulate("planar", 2, 4.0)
    readings = records(assembly.layout, sorted(simulation.readings, key=lambda one: one.t_ns))
    readings = readings[np.lexsort((readings["sensor"], readings["t_ns"]))]
    run = smoothed_run(assembly, readings)
    x, P = rts(assembly, readings)
    assert run.followed
    assert np.max(np.abs(run.states["x"] - x) / np.sqrt(np.diagonal(P, axis1=1, axis2=2))) < 1e-6
    assert run.states["P"] == pytest.approx(P, rel=1e-6, abs=1e-9)


def test_a_tape_reads_the_same_both_ways_from_memory_and_from_disk():
    """10,000 records in blocks of any size, once within the limit of memory and once a thousand times over it."""
    numbers = np.zeros(10_000, [("k", "<i8"), ("x", "<f8", (3,))])
    numbers["k"] = np.arange(10_000)
    for limit in (1 << 30, 320):
        tape = Tape(numbers.dtype, limit)
        for part in np.split(numbers, [1, 5000, 5000, 9999]):
            tape.append(part)
        assert np.array_equal(np.concatenate(list(tape.forwards())), numbers)
        assert np.array_equal(np.concatenate(list(tape.backwards())), numbers[::-1])
        tape.close()


def test_a_full_disk_is_named(monkeypatch):
    tape = Tape(np.dtype("<f8"))
    with monkeypatch.context() as patched:
        patched.setattr(tape._file, "write", _full)
        with pytest.raises(LogError, match=r"--smooth: .* MiB and more do not fit into .*TMPDIR"):
            tape.append(np.zeros(3))
    tape.close()


def _full(_):
    raise OSError(28, "No space left on device")


def test_a_recursion_without_factors_is_refused_by_name():
    with pytest.raises(ConfigError, match=r"--smooth: .*recursion"):
        smoothed_run(
            configured("reference_plant", {"filter": {"recursion": "conventional"}, "faults": None}), None
        )
