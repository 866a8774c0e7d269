"""Seed 002's misprints: each resolution, by a route that does not use the printed equation."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fusiond.models import ground_vehicle
from fusiond.models.contract import Process
from fusiond.models.sensors import gps_course
from fusiond.numerics.kernel import interpreted
from fusiond.recording.importing.numbers import Projection
from fusiond.simulation.vehicle_equations import Car
from fusiond.simulation.vehicle_manoeuvres import SEED_002
from fusiond.simulation.vehicle_sensors import readings
from tools.pages.trials import configured, records
from tools.pages.vehicle_bound import bound, ensemble

CAR = Car(drag_area_m2=0.7)


def process(**noise: float) -> Process:
    numbers = {
        "mass_kg": CAR.mass_kg, "yaw_inertia_kg_m2": CAR.yaw_inertia_kg_m2, "front_m": CAR.front_m,
        "rear_m": CAR.rear_m, "track_m": CAR.track_m, "drag_area_m2": CAR.drag_area_m2,
    }  # fmt: skip
    return ground_vehicle.describe(**numbers, force_noise_n_sqrt_s=0.0, **noise)


def step(x: np.ndarray, u: np.ndarray, dt_s: float) -> np.ndarray:
    after = np.zeros(10)
    p = np.array(process().parameters)
    interpreted(ground_vehicle.transition)(x, u, dt_s, p, after, np.zeros((10, 10)), np.zeros((10, 5)))
    return after


def look(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    h, H = np.zeros(4), np.zeros((4, 10))
    at = np.array([0, 1, 5, 6, 7])
    interpreted(gps_course.observe)(x, np.zeros(4), at, np.zeros(1), h, H)
    return h, H


def still(**states: float) -> np.ndarray:
    names = [slot.name for slot in ground_vehicle.STATES]
    return np.array([states.get(name, 0.0) for name in names])


@pytest.mark.parametrize("seed", range(20))
def test_the_equations_are_those_of_a_rigid_body_pushed_at_its_wheels(seed):
    """(6) as resolved equals r x F summed over four wheels to 1e-12, drag included, at steering up to 0.5 rad."""
    rng = np.random.default_rng(seed)
    x = rng.standard_normal(10) * [10, 3, 1, 3e3, 3e3, 2, 50, 50, 5, 5] + still(vx=20.0)
    u = np.append(rng.standard_normal(4) * 1e3, rng.uniform(-0.5, 0.5))
    dt_s = 1e-3
    pushed = CAR.push(u[None, :4], x[None, 3:5], u[4:], x[None, :2])[0]
    after = step(x, u, dt_s)
    assert after[8:] == pytest.approx(pushed[:2], rel=1e-12, abs=1e-12)
    assert (after[:3] - x[:3]) / dt_s == pytest.approx(
        [pushed[0] + x[1] * x[2], pushed[1] - x[0] * x[2], pushed[2]], rel=1e-9, abs=1e-9
    )


def test_the_front_axle_pushes_sideways_with_the_cosine_of_the_steering():
    """(6b) as printed gives F_SF / m, (3) gives F_SF cos(delta) / m: 12 % less at 0.5 rad."""
    after = step(still(vx=20.0, force_front=1000.0), np.array([0.0, 0.0, 0.0, 0.0, 0.5]), 1e-3)
    assert after[9] == pytest.approx(1000.0 * math.cos(0.5) / CAR.mass_kg, rel=1e-12)


def test_a_driven_front_wheel_pulls_the_nose_where_it_points():
    """(2) and (6c) as printed turn the car away from its steering; with + it turns left for left."""
    after = step(still(vx=20.0), np.array([500.0, 500.0, 0.0, 0.0, 0.1]), 1e-3)
    expected = 1000.0 * math.sin(0.1) * CAR.front_m / CAR.yaw_inertia_kg_m2
    assert after[2] / 1e-3 == pytest.approx(expected, rel=1e-9)
    assert after[2] > 0.0


def test_a_step_is_the_seeds_euler_step():
    """(11): what a step adds is proportional to its length; two halves are not one whole."""
    x = still(vx=20.0, vy=1.0, yaw_rate=0.5, force_front=500.0, yaw=0.3)
    u = np.array([0.0, 0.0, 100.0, 100.0, 0.05])
    whole = step(x, u, 1e-3)
    assert whole[:8] - x[:8] == pytest.approx(10.0 * (step(x, u, 1e-4)[:8] - x[:8]), rel=1e-9)
    halves = step(step(x, u, 5e-4), u, 5e-4)
    assert 1e-9 < abs(halves[6] - whole[6]) < 1e-5


@pytest.mark.parametrize("yaw", [-3.0, 0.0, 1.0, 3.1])
def test_sideslip_is_course_minus_yaw(yaw):
    """(7) as printed, psi - course, holds for compass bearings; (8) and (9) ask for course - psi."""
    x = still(vx=20.0, vy=2.0, yaw=yaw)
    moved = step(x, np.zeros(5), 1e-3) - x
    course = math.atan2(moved[7], moved[6])
    h, _ = look(x)
    assert math.remainder(h[1] - course, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)
    sideslip = math.remainder(h[1] - yaw, 2.0 * math.pi)
    assert h[0] * math.cos(sideslip) == pytest.approx(20.0)
    assert h[0] * math.sin(sideslip) == pytest.approx(2.0)


def derived_covariance(speed: float, sideslip: float) -> np.ndarray:
    """R of the seed's vx, vy, sideslip, heading, from the noise of speed, course, heading by (7) and (8)."""
    c, s = math.cos(sideslip), math.sin(sideslip)
    by_raw = np.array(
        [[c, -speed * s, speed * s], [s, speed * c, -speed * c], [0.0, 1.0, -1.0], [0.0, 0.0, 1.0]]
    )
    return by_raw @ np.diag([0.1**2, 0.01**2, 0.01**2]) @ by_raw.T


def test_the_seeds_four_channels_have_a_singular_covariance():
    """vx, vy, sideslip, heading are made of three numbers: rank 3, sideslip 0.01414 rad and tied to the heading."""
    R = derived_covariance(25.0, 0.05)
    assert np.linalg.matrix_rank(R, tol=1e-9) == 3
    assert math.sqrt(R[2, 2]) == pytest.approx(0.0141421, rel=1e-5)
    assert R[2, 3] == pytest.approx(-1e-4)  # + 1e-4 with the seed's sign of (7)


def test_taking_the_four_channels_as_independent_counts_information_twice():
    """The lateral velocity's variance would be reported half as large as it is: the raw three are fused for that."""
    speed = 25.0
    R = derived_covariance(speed, 0.0)
    # state: vx, vy, yaw
    H = np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 1.0 / speed, 0], [0, 0, 1.0]])
    claimed = np.linalg.inv(H.T @ np.diag(1.0 / np.diag(R)) @ H)
    raw = np.array([[1.0, 0, 0], [0, 1.0 / speed, 1.0], [0, 0, 1.0]])
    honest = np.linalg.inv(raw.T @ np.diag([1e2, 1e4, 1e4]) @ raw)
    assert honest[1, 1] / claimed[1, 1] == pytest.approx(2.0, rel=1e-6)


def dense_update(x, P, z, R, observe, wraps):
    """K = P H' S^-1 by a linear solve, x + K (z - h(x)): (16) and (17) as resolved."""
    h, H = observe(x)
    nu = z - h
    nu[wraps] = [math.remainder(value, 2.0 * math.pi) for value in nu[wraps]]
    S = H @ P @ H.T + R
    K = np.linalg.solve(S, H @ P).T
    return x + K @ nu, P - K @ H @ P


def test_an_update_compares_with_h_of_x_and_divides_from_the_right():
    """The engine's update with one GPS reading is that of the dense filter; with H X it would be metres off."""
    start = {"vx_m_s": 25.0, "vy_m_s": 1.0, "yaw_rad": 2.9, "x_m": 3.0}
    assembly = configured("ground_vehicle", {"initial": {"state": start}})
    engine = assembly.engine()
    x0 = still(vx=25.0, vy=1.0, yaw=2.9, x=3.0)
    P0 = np.diag([10.0, 0.5, 0.1, 500.0, 500.0, 0.1, 10.0, 10.0, 5.0, 5.0]) ** 2
    z = np.array([24.0, -3.1, 1.0, -2.0])
    batch = np.zeros(1, engine.layout.reading)
    batch["sensor"], batch["length"] = engine.layout.numbers["gps"], 4
    batch["z"][0, :4] = z
    report = engine.process(batch)[0]
    R = np.diag([0.1, 0.01, 0.1, 0.1]) ** 2
    x, P = dense_update(x0, P0, z, R, look, [1])
    assert report["x"] == pytest.approx(x, rel=1e-9, abs=1e-9)
    assert engine.covariance() == pytest.approx(P, rel=1e-6, abs=1e-9)
    h, H = look(x0)
    assert abs(h - H @ x0).max() > 0.03  # course is no linear function of the state


def two_scenarios(assembly, motion, given) -> np.ndarray:
    """The seed's loop: every millisecond predict, then one stacked update, IMU alone or all sensors at once."""
    p = np.array(assembly.resolved.process.parameters)
    R = {sensor.name: sensor.R for sensor in assembly.resolved.sensors}
    at: dict[int, dict[str, np.ndarray]] = {}
    for reading in given:
        at.setdefault(reading.t_ns, {})[reading.sensor] = np.array(reading.z)
    record = assembly.design[0]
    x, P, u = record["x0"].copy(), np.diag(record["d0"]), np.zeros(5)
    found = []
    for t_ns in sorted(at):
        if t_ns > 0:
            F, B, G, q = np.zeros((10, 10)), np.zeros((10, 5)), np.zeros((10, 5)), np.zeros(5)
            after = np.zeros(10)
            interpreted(ground_vehicle.transition)(x, u, 1e-3, p, after, F, B)
            interpreted(ground_vehicle.noise)(x, 1e-3, p, G, q)
            x, P = after, F @ P @ F.T + (G * q) @ G.T + B @ R["applied"] @ B.T
        u = at[t_ns].pop("applied")
        order = [name for name in ("gps", "imu", "magnetometer") if name in at[t_ns]]

        def stacked(x, order=order):
            parts = {
                "gps": look(x),
                "imu": (x[[8, 9, 2]], np.eye(10)[[8, 9, 2]]),
                "magnetometer": (x[5:6], np.eye(10)[5:6]),
            }
            return np.concatenate([parts[n][0] for n in order]), np.vstack([parts[n][1] for n in order])

        z = np.concatenate([at[t_ns][name] for name in order])
        block = np.zeros((len(z), len(z)))
        first = 0
        for name in order:
            size = len(R[name])
            block[first : first + size, first : first + size] = R[name]
            first += size
        angles = [i for name, i in (("gps", 1), ("magnetometer", len(z) - 1)) if name in order]
        x, P = dense_update(x, P, z, block, stacked, angles)
        found.append(x.copy())
    return np.array(found)


def test_asynchronous_sensors_are_the_seeds_two_scenarios():
    """One reading after the other gives the state of the seed's stacked updates within 0.02 sigma, for 0.5 s."""
    made = ensemble(SEED_002[0], 1, 0.5)
    motion = made.motions[0]
    given = readings(motion, 1, 5.0)
    engine = made.assembly.engine()
    batch = records(engine.layout, given)
    reports = engine.process(batch[np.lexsort((batch["sensor"], batch["t_ns"]))])
    last = np.flatnonzero(np.append(np.diff(reports["t_ns"]) != 0, True))
    stacked = two_scenarios(made.assembly, motion, given)
    assert stacked.shape == reports["x"][last].shape
    apart = np.abs(reports["x"][last] - stacked)[:, :8] / reports["std"][last, :8]
    assert apart.max() < 0.02


def test_the_bounds_recursion_is_the_filters_where_it_knows_the_truth():
    """Linearised at the truth or at its own estimate, the covariance is the same within 1 %, state by state."""
    made = ensemble(SEED_002[0], 1, 0.3)
    variances = bound(made.assembly.resolved, made.motions[0])
    drive = next(made.follow(made.assembly.engine(), 5))
    own = np.diagonal(drive.P, axis1=1, axis2=2)
    assert np.sqrt(own[-1, :8] / variances[-1, :8]) == pytest.approx(np.ones(8), rel=0.01)


def test_latitude_and_longitude_are_projected_as_the_seed_does():
    """y = R phi, x = R lambda cos(phi0): the importer's plane, but for the 0.7 % by which the earth is no sphere."""
    phi0, sphere_m, step_deg = 41.178, 6_371_000.0, 0.001
    plane = Projection((phi0, -8.596))
    east, north = plane.east_north_m(phi0 + step_deg, -8.596 + step_deg)
    assert north == pytest.approx(sphere_m * math.radians(step_deg), rel=0.007)
    assert east == pytest.approx(sphere_m * math.radians(step_deg) * math.cos(math.radians(phi0)), rel=0.007)
    twice = plane.east_north_m(phi0 + 2 * step_deg, -8.596 + 2 * step_deg)
    assert twice == pytest.approx((2 * east, 2 * north), rel=1e-6)  # equirectangular: linear in both
