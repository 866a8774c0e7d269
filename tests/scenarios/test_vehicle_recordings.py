"""Our driving of the multi-body simulator against drives of it that somebody else made, and sideslip on theirs."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.simulation.vehicle_manoeuvres import Manoeuvre
from tools.pages.multibody import drive, simulator
from tools.pages.sideslip import Course, lateral_velocity_rmse
from tools.pages.trials import configured

DRIVES = [(kind, speed) for kind in ("dlc", "jturn") for speed in (60, 100, 140)]


def table(folder, kind, speed):
    return np.genfromtxt(folder / f"{kind}_{speed}kmh.csv", delimiter=",", names=True)


@pytest.mark.recordings("commonroad_maneuvers")
@pytest.mark.parametrize(("kind", "speed"), DRIVES)
def test_their_steering_gives_their_motion(recording, kind, speed):
    """Their steering replayed: vx within 0.2 mm/s, vy 2 mm/s, yaw rate 0.0005 rad/s, position 2 cm, all the way."""
    theirs = table(recording("commonroad_maneuvers"), kind, speed)
    end_s = float(theirs["t"][-1])
    motion = drive(
        simulator(), speed / 3.6, lambda t: float(np.interp(t, theirs["t"], theirs["steer_rad"])), end_s
    )
    ours = motion.states[::10]
    for column, name, limit in (
        (0, "vx", 2e-4), (1, "vy", 2e-3), (2, "yaw_rate", 5e-4), (5, "psi", 1e-4), (6, "X", 0.02), (7, "Y", 0.02),
    ):  # fmt: skip
        assert np.abs(ours[:, column] - theirs[name]).max() < limit, name


@pytest.mark.recordings("commonroad_maneuvers")
@pytest.mark.parametrize(("kind", "speed"), DRIVES)
def test_our_manoeuvre_steers_as_theirs(recording, kind, speed):
    """Amplitude and times within 0.05 mrad, the error of their steering controller."""
    theirs = table(recording("commonroad_maneuvers"), kind, speed)
    asked = Manoeuvre(kind, float(speed))
    ours = np.array([asked.steering_rad(t) for t in theirs["t"]])
    assert np.abs(ours - theirs["steer_rad"]).max() < 5e-5
    assert asked.duration_s == pytest.approx(theirs["t"][-1] + 0.01, abs=1e-6)


def rmse(folder, kind, speed, with_imu=True):
    """Lateral velocity of the single-track filter on their drive; their acceleration is that of the row's instant."""
    d = table(folder, kind, speed)
    t_ns = np.round(d["t"] * 1e9).astype(np.int64)
    course = Course(t_ns, d["steer_rad"], d["vx"], d["vy"], d["yaw_rate"], d["ay_cg"])
    return lateral_velocity_rmse(configured("single_track").engine(), course, 3, with_imu)


@pytest.mark.recordings("commonroad_maneuvers")
@pytest.mark.parametrize(
    ("kind", "speed", "limit"), [("dlc", 60, 0.7), ("dlc", 140, 0.4), ("jturn", 60, 0.5)]
)
def test_two_readings_mend_the_sideslip_of_linear_tyres(recording, kind, speed, limit):
    """Lateral acceleration and yaw rate bring the error of vy down to this share of the package's own single track."""
    folder = recording("commonroad_maneuvers")
    d = table(folder, kind, speed)
    theirs = np.sqrt(np.mean((d["vy_single_track"] - d["vy"])[100:] ** 2))
    assert rmse(folder, kind, speed) < limit * theirs


@pytest.mark.recordings("commonroad_maneuvers")
def test_beyond_six_m_s2_linear_tyres_stay_wrong(recording):
    """The J-turn at 140 km/h corners at 8 m/s^2: more than 0.05 m/s RMSE remain, as docs/vehicle.md says."""
    assert rmse(recording("commonroad_maneuvers"), "jturn", 140) > 0.05
