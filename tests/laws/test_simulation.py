"""The simulated plants obey mechanics, and a seed names one run."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2, norm

from fusiond.errors import ConfigError
from fusiond.simulation import sensors
from fusiond.simulation.linear_plants import ReferencePlant
from fusiond.simulation.planar import PlanarState, PlanarVehicle
from fusiond.simulation.plants import BI_ROTOR, MINI_CAR, PointPlant, PointState, wall_robot_velocity
from fusiond.simulation.registry import SYSTEMS, simulate
from fusiond.simulation.streams import stream

ONE_S = 1_000_000_000
WORST_MISS = 1e-3
"""Two-sided probability of every interval below; the seeds are fixed, so a test that passes always passes."""


def assert_variance(samples: Any, variance: float, mean: float = 0.0) -> None:
    """The samples' mean and variance lie in the two-sided intervals of N(mean, variance)."""
    samples = np.asarray(samples)
    assert abs(samples.mean() - mean) <= norm.ppf(1.0 - WORST_MISS / 2.0) * np.sqrt(variance / samples.size)
    low, high = chi2.ppf([WORST_MISS / 2.0, 1.0 - WORST_MISS / 2.0], samples.size)
    assert low <= np.sum((samples - mean) ** 2) / variance <= high


def assert_white(samples: Any) -> None:
    """No correlation between neighbours, two-sided."""
    centred = np.asarray(samples) - np.mean(samples)
    correlation = np.sum(centred[1:] * centred[:-1]) / np.sum(centred**2)
    assert abs(correlation) <= norm.ppf(1.0 - WORST_MISS / 2.0) / np.sqrt(centred.size)


@given(st.floats(-20.0, 20.0), st.integers(1, 400), st.sampled_from([MINI_CAR, BI_ROTOR]))
def test_a_constant_force_moves_a_plant_as_galileo_says(
    force_n: float, steps: int, plant: PointPlant
) -> None:
    """x = x0 + a t^2 / 2 and v = a t with a = F / m - g, to rounding."""
    state = plant.start
    for _ in range(steps):
        state = plant.advance(state, force_n, 0.001)
    a, t = force_n / plant.mass_kg - plant.gravity_m_s2, steps * 0.001
    assert state.position_m == pytest.approx(plant.start.position_m + 0.5 * a * t * t, abs=1e-10)
    assert state.velocity_m_s == pytest.approx(a * t, abs=1e-10)
    assert state.acceleration_m_s2 == pytest.approx(a, abs=1e-9)


@given(st.lists(st.floats(-5.0, 15.0), min_size=1, max_size=60))
def test_work_becomes_kinetic_and_potential_energy(forces_n: list[float]) -> None:
    """The sum of F dz over any forces equals the gain of m v^2 / 2 + m g z."""
    state, work = BI_ROTOR.start, 0.0
    for force_n in forces_n:
        later = BI_ROTOR.advance(state, force_n, 0.02)
        work += force_n * (later.position_m - state.position_m)
        state = later
    m, g = BI_ROTOR.mass_kg, BI_ROTOR.gravity_m_s2
    gained = 0.5 * m * state.velocity_m_s**2 + m * g * (state.position_m - BI_ROTOR.start.position_m)
    assert gained == pytest.approx(work, abs=1e-9)


def test_the_finer_step_integrates_drag_that_a_single_step_would_not() -> None:
    """v = F/c (1 - exp(-c t / m)) with c t / m = 30 in one call: only substeps reach it."""
    plant = PointPlant(1.0, PointState(0.0, 0.0, 0.0), drag_n_s_per_m=30.0)
    fine = plant.advance(plant.start, 2.0, 1.0)
    coarse = PointPlant(1.0, plant.start, drag_n_s_per_m=30.0, substep_s=1.0).advance(plant.start, 2.0, 1.0)
    exact = 2.0 / 30.0 * (1.0 - np.exp(-30.0))
    assert fine.velocity_m_s == pytest.approx(exact, rel=1e-9)
    assert fine.position_m == pytest.approx(2.0 / 30.0 - exact / 30.0, rel=1e-9)
    assert abs(coarse.velocity_m_s - exact) > 1.0


def test_the_plants_have_the_masses_starts_and_gravity_of_the_seed() -> None:
    """Seed 000, table 1; without a force the bi-rotor has fallen 4.905 m after a second."""
    assert (MINI_CAR.mass_kg, MINI_CAR.weight_n, *MINI_CAR.start) == (1.0, 0.0, 0.0, 0.0, 0.0)
    assert (BI_ROTOR.mass_kg, *BI_ROTOR.start) == (0.5, 2.0, 0.0, 0.0)
    fallen = BI_ROTOR.advance(BI_ROTOR.start, 0.0, 1.0)
    assert fallen.position_m == pytest.approx(2.0 - 9.81 / 2.0, abs=1e-12)
    assert BI_ROTOR.weight_n == pytest.approx(0.5 * 9.81)


def test_the_wall_robot_drives_the_seeds_path() -> None:
    """101 rows of x = 0.05 t cos 2t; `velocity` is the mean of the derivative over the step that ended."""
    truth = simulate("wall_robot").truth
    t_s = truth.t_ns / ONE_S
    assert t_s.size == 101
    np.testing.assert_allclose(truth.column("position"), 0.05 * t_s * np.cos(2.0 * t_s), atol=1e-15)
    fine = wall_robot_velocity(np.linspace(t_s[:-1], t_s[1:], 201))
    means = (fine[0] / 2.0 + fine[1:-1].sum(axis=0) + fine[-1] / 2.0) / 200.0
    np.testing.assert_allclose(truth.column("velocity")[1:], means, atol=1e-6)


def test_the_reference_plant_is_moved_through_its_input_only() -> None:
    """x(k+1) - A x(k) = B (u(k) + w(k)) with white w of variance Q, and nothing across B."""
    plant = ReferencePlant(Q=2.3)
    states = plant.trajectory(20_000, stream(1, "plant"))
    rest = states[1:] - states[:-1] @ np.array(plant.A).T
    b = np.array(plant.B)
    along = rest @ b / (b @ b)
    np.testing.assert_allclose(rest, along[:, None] * b, atol=1e-12)
    w = along - np.sin(np.arange(20_000) / 5.0)
    assert_variance(w, 2.3)
    assert_white(w)


def test_the_reference_plant_starts_as_its_prior_says() -> None:
    """x(0) = B w with w of variance Q over 1000 seeds: covariance B Q B', of rank one."""
    plant = ReferencePlant(Q=2.3)
    starts = np.array([plant.trajectory(1, stream(seed, "plant"))[0] for seed in range(1000)])
    w = starts[:, 0] / plant.B[0]
    np.testing.assert_allclose(starts, w[:, None] * np.array(plant.B), atol=1e-12)
    assert_variance(w, 2.3)


def test_the_reference_plants_output_has_the_published_variance() -> None:
    """2.1527 for the part that noise drives at Q = 2.3; 2000 independent runs, two-sided."""
    driven = [ReferencePlant(Q=2.3).trajectory(60, stream(seed, "plant"))[-1, 0] for seed in range(2000)]
    calm = ReferencePlant(Q=0.0).trajectory(60, stream(0, "plant"))[-1, 0]
    assert_variance(np.array(driven) - calm, 2.1527)


def test_the_constant_velocity_plant_keeps_its_acceleration_for_a_step() -> None:
    """Each step adds a dt to v and v dt + a dt^2 / 2 to p, a white with variance q."""
    truth = simulate("constant_velocity", 3, 2000.0, q=4.0).truth
    p, v = truth.column("position"), truth.column("velocity")
    a = np.diff(v) / 0.1
    np.testing.assert_allclose(np.diff(p), 0.1 * v[:-1] + 0.005 * a, atol=1e-9)
    assert_variance(a, 4.0)
    assert_white(a)
    starts = [
        simulate("constant_velocity", seed, 0.1, start_std=(2.0, 0.5)).truth.values[0] for seed in range(500)
    ]
    assert_variance(np.array(starts)[:, 0], 4.0)
    assert_variance(np.array(starts)[:, 1], 0.25)


def test_a_steady_turn_is_a_circle() -> None:
    """Speed 5 m/s, yaw rate 0.2 rad/s, no noise: 40 s on a circle of 25 m, to a hundredth of a millimetre."""
    start = PlanarState(1.0, 2.0, 0.3, 5.0, 0.2, 0.0)
    vehicle = PlanarVehicle("white_acceleration", 0.0, 0.0, start=start, start_std=PlanarState(*[0.0] * 6))
    t_ns, states = vehicle.trajectory(40 * ONE_S, stream(0, "plant"))
    yaw = 0.3 + 0.2 * t_ns / ONE_S
    np.testing.assert_allclose(states[:, 2], yaw, atol=1e-9)
    np.testing.assert_allclose(states[:, 0], 1.0 + 25.0 * (np.sin(yaw) - np.sin(0.3)), atol=1e-5)
    np.testing.assert_allclose(states[:, 1], 2.0 - 25.0 * (np.cos(yaw) - np.cos(0.3)), atol=1e-5)


@pytest.mark.parametrize("motion", ["white_acceleration", "smooth"])
def test_the_planar_path_follows_its_own_speed_and_heading(motion: str) -> None:
    """Chords of 1 ms have the length v dt and the direction of the yaw; speed and yaw rate never jump."""
    truth = simulate("planar", 2, 30.0, motion=motion, aboard=("gps",), truth_period_s=0.001).truth
    dx, dy = np.diff(truth.column("x")), np.diff(truth.column("y"))
    v, yaw = truth.column("speed"), truth.column("yaw")
    along = dx * np.cos(yaw[:-1]) + dy * np.sin(yaw[:-1])
    np.testing.assert_allclose(along, 0.0005 * (v[1:] + v[:-1]), atol=1e-6)
    np.testing.assert_allclose(dy * np.cos(yaw[:-1]) - dx * np.sin(yaw[:-1]), 0.0, atol=1e-5)
    assert np.abs(np.diff(v)).max() < 0.05
    assert np.abs(np.diff(truth.column("yaw_rate"))).max() < 0.01
    np.testing.assert_allclose(truth.column("vx"), v * np.cos(yaw))


def test_speed_and_yaw_rate_wander_with_their_intensities() -> None:
    """Increments over 10 ms have variance intensity x dt, and are white."""
    truth = simulate("planar", 5, 100.0, aboard=("gps",), acceleration_intensity=0.2).truth
    assert_variance(np.diff(truth.column("speed")), 0.2 * 0.01)
    assert_variance(np.diff(truth.column("yaw_rate")), 0.002 * 0.01)
    assert_white(np.diff(truth.column("speed")))


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_seed_names_one_run(name: str) -> None:
    """The same seed gives the same bits, another none of them, a longer run the same beginning."""
    first, again = simulate(name, 1, 3.0), simulate(name, 1, 3.0)
    assert first.readings == again.readings
    assert first.truth.values.tobytes() == again.truth.values.tobytes()
    noisy = [r for r in first.readings if r.sensor != "applied"]
    assert not {r.z for r in noisy} & {r.z for r in simulate(name, 2, 3.0).readings if r.sensor != "applied"}
    longer = [r for r in simulate(name, 1, 5.0).readings if r.t_ns <= 3 * ONE_S]
    assert longer == list(first.readings)


@pytest.mark.parametrize("gone", sensors.PLANAR_SENSORS)
def test_dropping_a_sensor_changes_no_other(gone: str) -> None:
    whole = simulate("planar", 0, 3.0)
    rest = simulate("planar", 0, 3.0, aboard=tuple(name for name in sensors.PLANAR_SENSORS if name != gone))
    assert [r for r in whole.readings if r.sensor != gone] == list(rest.readings)
    np.testing.assert_array_equal(whole.truth.values, rest.truth.values)


def test_more_outputs_and_input_rows_change_nothing_else() -> None:
    one, two = (simulate("constant_velocity", 0, 10.0, R=R) for R in ((0.01,), (0.01, 1.0)))
    assert list(one.readings) == [r for r in two.readings if r.sensor == "y1"]
    bare, full = simulate("minicar", 0, 1.0), simulate("minicar", 0, 1.0, inputs=True)
    assert list(bare.readings) == [r for r in full.readings if r.sensor in ("accelerometer", "ultrasonic")]
    assert Counter(r.sensor for r in full.readings)["applied"] == 1001
    assert full.of("reference")[1].tolist() == [[2.0]]


@pytest.mark.parametrize(
    ("name", "keywords", "says"),
    [
        ("minicat", {}, "choose one of minicar"),
        ("minicar", {"speed": 1}, "choose from feedback"),
        ("minicar", {"feedback": "kalman"}, "choose from ideal"),
        ("minicar", {"goal_m": "far"}, "no finite number"),
        ("minicar", {"inputs": 1}, "neither true nor false"),
        ("minicar", {"duration_s": 0.0}, "not above 0"),
        ("minicar", {"duration_s": float("nan")}, "not above 0"),
        ("minicar", {"seed": -1}, "below 0"),
        ("minicar", {"duration_s": 0.1, "delay_s": {"sonar": 1.0}}, "choose from accelerometer"),
        ("minicar", {"jitter_s": -0.1}, "give 0 or more"),
        ("planar", {"aboard": ("lidar",)}, "choose from gps"),
        ("planar", {"aboard": ("gps", "gps")}, "at most once"),
        ("planar", {"motion": "wild"}, "choose from white_acceleration"),
        ("reference_plant", {"R": (-1.0,)}, "give 0 or more"),
        ("reference_plant", {"R": 1.0}, "no list of numbers"),
        ("constant_velocity", {"start_std": (1.0,)}, "give 2"),
    ],
)
def test_an_operators_mistake_is_named_with_its_remedy(
    name: str, keywords: dict[str, Any], says: str
) -> None:
    with pytest.raises(ConfigError, match=says):
        simulate(name, **keywords)


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_run_shorter_than_a_period_has_its_first_row(name: str) -> None:
    run = simulate(name, 0, 0.0004)
    assert run.truth.t_ns.tolist() == [0]
    assert {r.t_ns for r in run.readings} == {0}
