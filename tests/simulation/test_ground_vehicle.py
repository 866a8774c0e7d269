"""Seed 002's car as `simulate` and `fusiond demo` drive it: tyres, driver, sensors, and the filter that follows it."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from scipy.stats import chi2

from fusiond.errors import ConfigError
from fusiond.simulation.registry import simulate
from fusiond.simulation.vehicle_drive import Tyres, follow, wheel_forces_n
from fusiond.simulation.vehicle_equations import Car
from fusiond.simulation.vehicle_manoeuvres import SEED_002, WHEELBASE_M, Manoeuvre
from fusiond.simulation.vehicle_sensors import MEASURED, readings
from tools.pages.trials import configured
from tools.pages.vehicle_runs import SEED_STATES
from tools.pages.vehicle_runs import follow as filtered

MULTIBODY_M_S2 = (4.6, 5.2, 6.1, 7.3, 4.9, 6.0, 7.3)
"""Largest lateral acceleration of the 29-state car in each of the seed's manoeuvres (docs/vehicle.md)."""


def test_tyres_are_linear_at_first_and_give_no_more_than_friction():
    """21.92 times the load per rad of small slip, mu times the load at most, to the other side alike."""
    tyres, load_n = Tyres(), 5000.0
    assert tyres.lateral_n(load_n, 1e-4) == pytest.approx(21.92 * load_n * 1e-4, rel=1e-5)
    assert tyres.lateral_n(load_n, -0.03) == -tyres.lateral_n(load_n, 0.03)
    assert tyres.lateral_n(load_n, 1.0) == pytest.approx(1.0489 * load_n)


def test_a_slow_steady_turn_has_the_radius_of_its_steering():
    """Tyre slopes that go with the loads steer neutrally (Rajamani 2012, 3.3): yaw rate = v angle / wheelbase."""
    asked = Manoeuvre("jturn", 30.0)
    motion = follow(asked, 5000)
    vx, rate = motion.states[-1, 0], motion.states[-1, 2]
    # tyres that bend and angles that are not small cost three per cent here
    assert rate == pytest.approx(vx * asked.amplitude_rad / WHEELBASE_M, rel=0.05)
    assert vx == pytest.approx(asked.speed_m_s, rel=0.02)


@pytest.mark.parametrize(("asked", "known_m_s2"), list(zip(SEED_002, MULTIBODY_M_S2, strict=True)))
def test_it_corners_like_the_multi_body_car(asked, known_m_s2):
    """The largest lateral acceleration is within 3 % of a simulator's that shares nothing with this one."""
    motion = follow(asked, round(asked.duration_s * 1000))
    assert np.abs(motion.states[:, 9]).max() == pytest.approx(known_m_s2, rel=0.03)


def test_a_double_lane_change_ends_in_its_own_lane():
    """60 km/h: a lane of 4 to 5.5 m to the left and back to within 5 cm, straight again, the speed kept."""
    truth = simulate("ground_vehicle").truth
    assert 4.0 < truth.column("y").max() < 5.5
    assert abs(truth.column("y")[-1]) < 0.05
    assert abs(truth.column("yaw")[-1]) < 1e-3
    assert np.abs(truth.column("vx") * 3.6 - 60.0).max() < 0.5


def test_the_driver_brakes_in_front_and_pushes_behind():
    assert wheel_forces_n(Car(), 1.0) == (0.0, 0.0, 1093.295, 1093.295)
    assert wheel_forces_n(Car(), -1.0) == pytest.approx((-721.575, -721.575, -371.720, -371.720), abs=1e-3)


def test_its_sensors_are_those_of_the_configuration():
    """Names, channels, rates and noise; only a force's noise is a share of it and so no number."""
    run, layout = simulate("ground_vehicle", 0, 1.0), configured("ground_vehicle").layout
    assert Counter(r.sensor for r in run.readings) == {
        "applied": 1001, "imu": 1000, "gps": 11, "magnetometer": 11,
    }  # fmt: skip
    channels = {sensor.name: len(sensor.channels) for sensor in layout.sensors}
    assert {r.sensor: len(r.z) for r in run.readings} == channels
    assert {one.name: one.channels for one in MEASURED} == channels
    sections = configured("ground_vehicle").config.sensor
    for one in MEASURED[1:]:
        assert one.sigma == tuple(sections[one.name].noise_std.values())


@pytest.mark.parametrize("asked", [SEED_002[0], SEED_002[-1]], ids=lambda asked: asked.name)
def test_the_filter_follows_it_and_knows_how_well(asked):
    """Nobody told the filter of tyres: its mean NEES over 2 s is below what a single draw may be."""
    motion = follow(asked, 3000)
    drive = filtered(configured("ground_vehicle").engine(), motion, readings(motion, 3))
    nees = [drive.nees(row) for row in range(1000, len(drive.t_s), 20)]
    assert np.mean(nees) < chi2.ppf(0.999, SEED_STATES)
    assert np.sqrt(np.mean(drive.error[1000:, 6:8] ** 2)) < 0.1


def test_its_imu_can_lie():
    honest, lying = (
        simulate("ground_vehicle", 0, 0.5),
        simulate("ground_vehicle", 0, 0.5, inject=["imu.1.bias=1@0.2"]),
    )
    apart = lying.of("imu")[1] - honest.of("imu")[1]
    assert apart[198].tolist() == [0.0, 0.0, 0.0]
    assert apart[200] == pytest.approx([0.0, 1.0, 0.0])
    assert apart.shape == (500, 3)


@pytest.mark.parametrize(
    ("keywords", "says"),
    [
        ({"manoeuvre": "slalom"}, "choose from dlc, jturn"),
        ({"speed_km_h": 10}, "give 20 or more"),
        ({"speed_km_h": 300}, "give 160 or less"),
        ({"inject": ["applied.noise=3@0"]}, "not known"),
    ],
)
def test_an_operators_mistake_is_named_with_its_remedy(keywords, says):
    with pytest.raises(ConfigError, match=says):
        simulate("ground_vehicle", 0, 0.01, **keywords)
