"""Seed 001: the wall robot, corrected and as printed."""

from __future__ import annotations

import numpy as np
import pytest

from tools.pages import seed_001
from tools.pages.trials import CONFIGS


def test_it_settles_where_the_closed_form_says():
    """Gain 0.48051 and P 4.3246e-4 to 1e-4, in both configurations."""
    exact = seed_001.closed_form()
    assert exact.gain == pytest.approx(0.48051, abs=1e-5)
    assert exact.P_after == pytest.approx(4.3246e-4, rel=1e-4)
    for config in ("wall_robot", "wall_robot_as_written"):
        steady = seed_001.figures(config).steady
        assert steady.gain == pytest.approx(exact.gain, rel=1e-9)
        assert steady.P_after == pytest.approx(exact.P_after, rel=1e-9)


def test_corrected_it_reaches_the_limit():
    """RMSE of 400 runs within 2 % of 0.0208 m, and as sure of itself as it may be (NEES 1)."""
    corrected = seed_001.figures("wall_robot")
    assert corrected.rmse_m == pytest.approx(0.0208, rel=0.02)
    assert corrected.nees_mean == pytest.approx(1.0, abs=0.03)


def test_as_printed_it_is_off_by_one():
    """Predicting with u(i-1): RMSE 0.0227 m, while it reports the same variance (NEES 1.19)."""
    printed = seed_001.figures("wall_robot_as_written")
    assert printed.rmse_m == pytest.approx(0.02269, rel=0.02)
    assert printed.nees_mean == pytest.approx(1.19, abs=0.03)


def test_the_printed_program_is_what_the_engine_runs():
    """GIVEN one run; WHEN the printed loop runs with its u(i-1), and with u(i); THEN both are the engine's to 1e-12."""
    run = seed_001.simulations()[0]
    u, z = run.of("speed")[1][:, 0], run.of("range")[1][:, 0]
    truth = run.truth.column("position")
    for config, behind in (("wall_robot_as_written", 1), ("wall_robot", 0)):
        x, P = 0.0, 0.0
        errors = []
        for i in range(1, len(z)):
            x, P = x + 0.1 * u[i - behind], P + seed_001.Q_M2
            K = P / (P + seed_001.R_M2)
            x, P = x + K * (z[i] - x), (1.0 - K) * P
            errors.append(x - truth[i])
        np.testing.assert_allclose(seed_001.figures(config).error[0], errors, atol=1e-12)


def test_one_word_is_the_whole_difference():
    """The two configurations differ in `hold` and their names only; faults are looked for with the right model."""
    lines = [
        [
            line.split("#")[0].strip()
            for line in (CONFIGS / f"{name}.toml").read_text().partition("[faults]")[0].splitlines()
        ]
        for name in ("wall_robot", "wall_robot_as_written")
    ]
    said = [[line for line in text if line] for text in lines]
    changed = [pair for pair in zip(*said, strict=True) if pair[0] != pair[1]]
    assert [one for one, _ in changed] == ['name = "wall_robot"', 'hold = "previous"']


def test_one_sigma_is_two_thirds():
    """The band that the seed plots holds 68 % of the errors (theory 68.27 %)."""
    assert seed_001.figures("wall_robot").within_one_sigma == pytest.approx(0.6827, abs=0.01)
