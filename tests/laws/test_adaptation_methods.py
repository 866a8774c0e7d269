"""Laws of the methods that estimate noise: what each kernel computes, found by another route."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from fusiond.adapt import fuzzy, fuzzy_additive, fuzzy_design, interacting, variational
from fusiond.adapt.guards import held
from fusiond.adapt.slow import CLIPPED, LARGEST, slow_ratio, slow_start
from fusiond.assembly.adapting import COARSE, ladder, rules_of
from fusiond.assembly.assembly import assemble
from fusiond.config import AdaptationSection, Config, FuzzySection
from fusiond.numerics.kernel import interpreted
from tools.scoreboard.steps_of_noise import configuration

METHODS = {
    "interacting": interacting, "variational": variational, "fuzzy": fuzzy, "fuzzy_additive": fuzzy_additive,
}  # fmt: skip


def tables(method: str):
    """The design record's noise tables of a constant-velocity configuration with this method."""
    return assemble(Config.model_validate(configuration(method=method))).design[0]["noise"]


def test_interacting_models_are_the_matched_mixture_of_the_updates_by_every_level():
    # GIVEN weights of three levels, a prior N(0, t) of what is measured, and a reading nu
    level, jump, before = np.array([0.3, 1.0, 4.0]), np.array([0.5, 0.3, 0.2]), np.array([0.2, 0.7, 0.1])
    noise = SimpleNamespace(level=level, jump=jump[None, None], hazard=0.05)
    t, nu, memory, said = 0.8, 1.9, before.copy(), np.zeros(4)

    # WHEN the kernel weighs it
    interpreted(interacting.weigh)(memory, noise, 0, 0, 1.0, nu, t, said)

    # THEN weights, mean and variance are those of the mixture computed from its parts
    weights = (0.95 * before + 0.05 * jump) * norm.pdf(nu, scale=np.sqrt(t + level))
    weights /= weights.sum()
    means, variances = t / (t + level) * nu, t * level / (t + level)
    mean = weights @ means
    variance = weights @ (variances + (means - mean) ** 2)
    r, ratio, added = said[:3]
    np.testing.assert_allclose(memory, weights, rtol=1e-12)
    assert ratio == pytest.approx(weights @ level, rel=1e-12)
    assert t / (t + r) * nu == pytest.approx(mean, rel=1e-12)
    assert t * r / (t + r) + t * t * added == pytest.approx(variance, rel=1e-12)


def test_a_reading_far_out_leaves_numbers():
    noise = tables("interacting")
    memory, said = np.zeros(len(noise["level"])), np.zeros(4)
    interpreted(interacting.begin)(memory, noise, 0, 0, 1.0)
    interpreted(interacting.weigh)(memory, noise, 0, 0, 1.0, 1e9, 0.1, said)
    assert np.isfinite(memory).all()
    assert memory.sum() == pytest.approx(1.0)
    assert np.isfinite(said[:2]).all()
    assert said[1] > 1e3


def test_variational_inference_turns_as_the_filter_of_its_source_does():
    """Algorithm 1 of Sarkka & Nummenmaa with its own Kalman update, three turns, gives the same R."""
    noise, memory, said = SimpleNamespace(forget=0.95), np.array([7.0]), np.zeros(4)
    R, P, nu = 1.7, 0.6, 2.2
    interpreted(variational.weigh)(memory, noise, 0, 0, R, nu, P, said)

    a, b = 0.95 * 7.0 + 0.5, 0.95 * 7.0 * R
    ratio = R
    for _ in range(3):
        K = P / (P + ratio)
        x, after = K * nu, P - K * P
        ratio = (b + 0.5 * (nu - x) ** 2 + 0.5 * after) / a
    assert said[0] == pytest.approx(ratio, rel=1e-12)
    assert memory[0] == pytest.approx(a)


@pytest.mark.parametrize("method", METHODS)
def test_compiled_methods_are_the_interpreted_ones(method):
    module, noise = METHODS[method], tables(method)
    rng = np.random.default_rng(3)
    size = {"interacting": len(noise["level"]), "variational": 1}.get(method, 4)
    memories, said = (np.zeros(size), np.zeros(size)), (np.zeros(4), np.zeros(4))
    for memory in memories:
        interpreted(module.begin)(memory, noise, 0, 0, 1.0)
    ratio = 1.0
    for nu in rng.standard_normal(80) * np.repeat([1.0, 5.0], 40):
        module.weigh(memories[0], noise, 0, 0, ratio, nu, 0.4, said[0])
        interpreted(module.weigh)(memories[1], noise, 0, 0, ratio, nu, 0.4, said[1])
        np.testing.assert_allclose(said[0][:3], said[1][:3], rtol=1e-12, atol=1e-15)
        ratio = float(np.clip(said[0][1], 0.01, 100.0))
    assert ratio > 3.0


@given(
    ratio=st.floats(allow_nan=True, allow_infinity=True),
    before=st.floats(1e-2, 1e4),
    most=st.floats(1e-3, 5.0),
)
def test_guards_hold_whatever_a_method_says(ratio, before, most):
    """Never negative, never beyond floor and ceiling, never faster than allowed; what is no number changes nothing."""
    kept = interpreted(held)(ratio, before, 0.01, 1e4, most)
    assert 0.01 <= kept <= 1e4
    assert kept / before <= np.exp(most) * (1.0 + 1e-9)
    assert before / kept <= np.exp(most) * (1.0 + 1e-9)
    if not ratio > 0.0 or not np.isfinite(ratio):
        assert kept == before


def test_the_additive_design_can_step_below_zero_where_its_floor_holds_it():
    noise = tables("fuzzy_additive")
    memory, said = np.array([30.0, 0.0, 0.0001, 5.0]), np.zeros(4)
    interpreted(fuzzy_additive.weigh)(memory, noise, 0, 0, 0.05, 0.0, 5.0, said)
    assert 0.05 + noise["table"][-1, 0] < 0.0
    assert interpreted(held)(said[1], 0.05, 0.01, 1e4, np.log(10.0)) >= 0.01


def test_the_slow_ratio_is_clipped_without_a_bias():
    """CLIPPED is the mean square of a normal number limited to LARGEST; a settled slow ratio stays at the truth."""
    x = np.linspace(-12.0, 12.0, 400_001)
    clipped = np.trapezoid(np.minimum(x * x, LARGEST**2) * norm.pdf(x), x)
    assert pytest.approx(clipped, abs=1e-5) == CLIPPED
    rng, ratio, weight, mean, kept = np.random.default_rng(5), 1.0, slow_start(0.995), 0.0, []
    for _ in range(20_000):
        nu = rng.standard_normal() * np.sqrt(0.5 + 2.0)
        ratio = slow_ratio(ratio, weight, 0.995, nu, mean, 0.02, 0.5)
        weight = 0.995 * weight + 0.5
        mean += 0.02 * (nu - mean)
        kept.append(ratio)
    assert np.mean(kept[2000:]) == pytest.approx(2.0, rel=0.05)


def test_a_bias_does_not_raise_the_slow_ratio_as_noise_of_its_size_would():
    found = {}
    for kind in ("bias", "noise"):
        rng, ratio, weight, mean = np.random.default_rng(6), 1.0, slow_start(0.995), 0.0
        for _ in range(600):
            nu = rng.standard_normal() * np.sqrt(1.5) * (1.0 if kind == "bias" else 2.2)
            nu += 3.0 if kind == "bias" else 0.0
            ratio = slow_ratio(ratio, weight, 0.995, nu, mean, 0.02, 0.5)
            weight = 0.995 * weight + 0.5
            mean += 0.02 * (nu - mean)
        found[kind] = ratio
    assert found["bias"] < 1.8
    assert found["noise"] > 4.0


def test_the_table_is_scikit_fuzzy_to_a_thousandth():
    """At points the table does not hold; the change of ln R differs by no more than 1e-3 a reading."""
    section = FuzzySection()
    rng = np.random.default_rng(7)
    scatter, mean = rng.uniform(-3.0, 3.0, 300), rng.uniform(0.0, 5.0, 300)
    exact = section.step * fuzzy_design.evaluate(rules_of(section), scatter, mean)
    noise = tables("fuzzy")
    read = [interpreted(fuzzy.look_up)(noise, y, x) for y, x in zip(scatter, mean, strict=True)]
    assert np.max(np.abs(exact - read)) <= 1e-3


def test_the_rules_rest_where_all_is_as_expected_and_where_a_mean_says_bias():
    noise = tables("fuzzy")
    look = interpreted(fuzzy.look_up)
    assert abs(look(noise, 0.0, 0.5)) < 1e-6
    assert abs(look(noise, 2.0, 4.5)) < 1e-6
    assert look(noise, 2.0, 0.5) == pytest.approx(0.35, abs=1e-3)
    assert look(noise, -2.5, 0.5) == pytest.approx(-0.35, abs=1e-3)
    assert np.isfinite(look(noise, 1e9, 1e9))


@given(floor=st.floats(1e-4, 0.9), ceiling=st.floats(1.1, 1e6), stays=st.floats(2.0, 1e6))
def test_the_ladder_goes_from_floor_to_ceiling_without_a_gap(floor, ceiling, stays):
    level = ladder(AdaptationSection(floor=floor, ceiling=ceiling, readings_between_jumps=stays))
    assert level[0] == pytest.approx(floor)
    assert level[-1] == pytest.approx(ceiling)
    assert np.all(level[1:] / level[:-1] <= COARSE * (1.0 + 1e-9))
