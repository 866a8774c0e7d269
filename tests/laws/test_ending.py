"""The end of an error that is taken off is as likely as a brute-force marginal likelihood says."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from fusiond.engine.correction import once_gone
from fusiond.faults.ending import find_ending
from fusiond.faults.records import reaction_dtype
from fusiond.faults.response import respond
from tests.laws.glr_rig import Run, constant_velocity

SIZE, END, STEPS = 0.8, 30, 50


def window_after_an_end(end: int = END) -> np.ndarray:
    """A sensor in two: the second is used with SIZE taken off, and errs by as much until step `end`."""
    run = Run(constant_velocity(2), seed=5)
    for k in range(STEPS):
        run.step(fault={1: lambda k, h: np.array([-SIZE])} if k >= end else {})
    return run.window(len(run.lines))


def test_the_likelihood_of_an_end_is_that_of_innovations_with_a_normal_size():
    """e ~ N(w, I + v w w') against N(0, I), w of the error left since the onset; and what the onset costs."""
    window, unsure = window_after_an_end(), 0.3
    left = np.full((len(window), 1), -SIZE)
    response = respond(window, 1)
    found = find_ending(response, 1, (), left, unsure)
    assert found is not None
    assert window["t_ns"][found.onset] == window["t_ns"][window["sensor"] == 1][END]
    own = np.flatnonzero(window["sensor"] == 1)
    columns = response.raw[own[own >= found.onset], 0]
    w = response.impulses[:, columns].sum(axis=1) * -SIZE
    with_end = multivariate_normal(w, np.eye(len(w)) + unsure**2 * np.outer(w, w)).logpdf(response.e)
    without = multivariate_normal(np.zeros(len(w)), np.eye(len(w))).logpdf(response.e)
    assert found.score == pytest.approx(with_end - without - np.log(len(own)), rel=1e-9)


def test_no_end_is_found_where_none_was():
    window = window_after_an_end(end=STEPS)
    found = find_ending(respond(window, 1), 1, (), np.full((len(window), 1), -SIZE), 0.1)
    assert found is not None
    assert found.score < 0.0


def test_what_is_left_once_an_error_has_gone_undoes_the_correction():
    """A corrected reading of an honest h is (h - o - d t) / (1 + g) + lag dh/dt; the rest is what errs."""
    window = window_after_an_end()
    reaction = np.zeros(1, reaction_dtype(sensors=2, payload=1))[0]
    reaction["from_ns"][1, 1] = from_ns = int(window["t_ns"][20])
    sizes = {"offset": 0.5, "drift": 0.1, "gain_error": 0.25, "lag": 0.2}
    for name, size in sizes.items():
        reaction[name][1, 1, 0] = size
    left = once_gone(window, reaction, 1)
    since_s = (window["t_ns"] - from_ns) * 1e-9
    told = (window["h"][:, 0] - 0.5 - 0.1 * since_s) / 1.25 + 0.2 * window["hdot"][:, 0]
    assert left[20:, 0] == pytest.approx((told - window["h"][:, 0])[20:])
    assert not left[:20].any()
