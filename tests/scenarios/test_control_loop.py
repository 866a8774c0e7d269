"""LQG with integral action on the simulated mini car: limits, slopes, moving goals; and the car through its J-turn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fusiond.assembly.assembly import assemble
from fusiond.config import Config
from fusiond.simulation.plants import MINI_CAR
from fusiond.simulation.rig import minicar
from fusiond.simulation.tables import Reading
from tools.pages.trials import configured, records, steer
from tools.pages.yaw_tracking import turn

SECOND = 1_000_000_000


@pytest.fixture(scope="module")
def engine():
    """The mini car's, nothing watched; its tables may be changed, its step not."""
    return configured("minicar_lqg").engine()


def retuned(engine, **control):
    """The same step with another law's numbers."""
    engine._design[:] = configured("minicar_lqg", {"control": control}).design
    return engine


def test_a_limit_does_not_wind_the_integral_up(engine):
    """GIVEN 2 m to go with 1 N, WHEN the integral gives back what the limit took, THEN it overshoots by less than 2 %;
    WHEN it does not, THEN by more than a tenth."""
    tame = steer(retuned(engine), minicar(0), 12 * SECOND).loop.states[:, 0]
    wound = steer(retuned(engine, unwinding_s=1e9), minicar(0), 12 * SECOND).loop.states[:, 0]
    assert tame.max() < 2.04
    assert wound.max() > 2.2


def test_a_slope_moves_the_rest_only_without_an_integral(engine):
    """GIVEN a slope that takes 0.1 N, of which the law knows nothing, THEN the car stands at its goal within 5 mm, and
    without the integral 0.1 N over the gain away."""

    def rest(**control):
        rig = minicar(1)
        rig.plant = replace(MINI_CAR, gravity_m_s2=0.1)
        states = steer(retuned(engine, **control), rig, 20 * SECOND).loop.states
        return float(states[-3000:, 0].mean())

    assert rest() == pytest.approx(2.0, abs=0.005)
    without = {"integral_cost": {"position": 1e-9}, "unwinding_s": 1e9}
    plain = configured("minicar_lqg", {"control": without})
    assert rest(**without) == pytest.approx(2.0 - 0.1 / plain.plan.K[0, 0], abs=0.005)


def test_the_goal_moves_by_a_message(engine):
    """WHEN 1 m comes on `reference` at 8 s, THEN the car turns round and stands there."""
    retuned(engine).reset()
    rig, force_n = minicar(2), 0.0
    now = rig.begin()
    for step in range(18_000):
        now = rig.advance(force_n) if step else now
        if step == 8000:
            now = [*now, Reading(rig.t_ns, "reference", (1.0,))]
        for one in records(engine.layout, now):
            report = engine.process(one.reshape(1))[0]
            if report["command_due"]:
                force_n = float(report["command"][0])
                assert -1.0 <= force_n <= 1.0
    assert rig.state.position_m == pytest.approx(1.0, abs=0.01)


def test_a_disturbance_that_is_a_state_is_made_up_for():
    """x+ = 0.9 x + d + u, d constant and estimated: x rests at the reference, whatever d."""
    text = {
        "name": "offset", "initial": {"std": {"x": 1.0, "d": 1.0}},
        "model": {
            "kind": "linear", "step_s": 1.0, "states": ["x", "d"], "inputs": ["u"], "A": [[0.9, 1.0], [0.0, 1.0]],
            "B": [[1.0], [0.0]], "G": [[1.0, 0.0], [0.0, 1.0]], "Q": [[1e-4, 0.0], [0.0, 1e-6]],
        },
        "sensor": {"y": {"kind": "linear", "H": [[1.0, 0.0]], "channels": ["y"], "noise_std": {"y": 0.01}}},
        "control": {
            "law": "lqg", "rate_hz": 1.0, "controls": ["u"], "state_cost": {"x": 1.0}, "input_cost": {"u": 1.0},
            "tracks": ["x"], "disturbances": ["d"],
        },
    }  # fmt: skip
    plan = assemble(Config.model_validate(text)).plan
    x, d, reference = 0.0, -0.3, 2.0
    for _ in range(60):
        aim = plan.targets @ np.array([reference, d, 1.0])
        x = 0.9 * x + d + aim[1] - plan.K[0, 0] * (x - aim[0])
    assert x == pytest.approx(reference, abs=1e-9)
    assert plan.states == ("x",)


def test_the_car_follows_the_yaw_rate_of_its_j_turn():
    """At the speed of the design and 30 km/h to either side: within 2 % in the turn, within 10 % on the way into it."""
    engine = configured("single_track_lqg").engine()
    for speed_km_h in (60.0, 90.0, 120.0):
        driven = turn(engine, speed_km_h)
        assert driven.steady_rms < 0.02
        assert driven.largest < 0.10
        assert np.abs(np.diff(driven.steering)).max() <= 0.01 + 1e-9
