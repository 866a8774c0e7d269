"""Laws of adaptation in the step: which R goes where, what stays as it was, and what outlives what."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.assembly.assembly import assemble
from fusiond.assembly.package import noise_sources
from fusiond.assembly.retracing import tracer_of
from fusiond.config import Config, parse
from fusiond.engine import step
from fusiond.engine.noise_learnt import learnt, recall
from fusiond.errors import ConfigError
from fusiond.recording.digest import OutputDigest
from fusiond.recording.log import open_log
from fusiond.recording.mcap_writer import McapWriter
from fusiond.service.noise_file import read_noise, write_noise
from fusiond.types import RESET, Verdict
from tests.laws.adaptation_rig import CONFIG, R, adapted, measured, readings_of
from tools.scoreboard.steps_of_noise import configuration


def text_of(*, adaptation: str = "", topology: str = "centralized", recursion: str = "ud") -> str:
    """Two sensors on constant velocity, in a plain step, which compiles nothing."""
    sensors = "".join(
        f'[sensor.{name}]\nkind = "linear"\nH = [[1.0, 0.0]]\nchannels = ["y"]\nnoise_std = {{ y = 0.1 }}\n'
        for name in ("y1", "y2")
    )
    return f"""
name = "pair"
[model]
kind = "linear"
step_s = 0.1
states = ["position", "velocity"]
A = [[1.0, 0.1], [0.0, 1.0]]
G = [[0.005], [0.1]]
Q = [[1.0]]
[initial]
std = {{ position = 1.0, velocity = 1.0 }}
{sensors}
[filter]
recursion = "{recursion}"
[fusion]
topology = "{topology}"
{adaptation}
"""


def pair_readings(assembly, steps=400, std=(0.1, 0.5), seed=3):
    """Readings of both sensors in turn, each with its own noise."""
    readings = np.zeros(2 * steps, assembly.layout.reading)
    truth = measured(steps, 0.0, seed)
    noise = np.random.default_rng(seed + 1).standard_normal((steps, 2)) * std
    readings["t_ns"] = np.repeat((np.arange(steps) + 1) * 100_000_000, 2)
    readings["sensor"], readings["length"] = np.tile([0, 1], steps), 1
    readings["z"][:, 0] = (truth[:, None] + noise).ravel()
    return readings


def test_without_the_section_the_step_is_the_template_and_its_records_know_nothing_of_noise():
    config = {name: part for name, part in configuration().items() if name != "adaptation"}
    assembly = assemble(Config.model_validate(config))
    assert assembly.layout.shape.adapt is None
    assert "noise" not in assembly.layout.track.names
    assert "noise" not in assembly.design.dtype.names
    files = noise_sources(assembly.layout.shape, {"adapt.py": "as it stands"}, None)
    assert files == {"adapt.py": "as it stands"}
    assert step.__name__ == "fusiond.engine.step"


def test_a_sensor_that_opts_out_gives_the_bits_of_no_adaptation():
    asked = text_of(adaptation="[adaptation]").replace("noise_std", "adapt_noise = false\nnoise_std")
    reports = []
    for text in (text_of(recursion="conventional"), asked.replace('"ud"', '"conventional"')):
        assembly = assemble(parse(text, "test"))
        reports.append(assembly.engine().process(pair_readings(assembly)).copy())
    assert reports[0].tobytes() == reports[1].tobytes()


def test_the_report_tells_the_trusted_and_the_declared_variance():
    reports = adapted().engine().process(readings_of(measured(400, 0.5, 1)))
    np.testing.assert_allclose(reports["R_declared"][:, 0], R)
    assert reports["R_used"][0, 0] == pytest.approx(R)
    assert np.median(reports["R_used"][100:, 0]) == pytest.approx(0.25, rel=0.2)
    S = reports["S"][:, 0]
    np.testing.assert_allclose(reports["nis"], reports["nu"][:, 0] ** 2 / S, rtol=1e-9)


def test_the_estimate_of_the_levels_is_their_mixture():
    """Row 0 is the moment match of the bins: mean and covariance, after every reading."""
    engine = adapted().engine()
    for readings in np.array_split(readings_of(measured(60, np.repeat([0.1, 0.5], 30), 2)), 60):
        engine.process(readings)
        memory = engine.track[0]["noise"]["memory"][0, 0, 0]
        shares = memory.reshape(4, -1).sum(axis=1)
        kept = shares > 1e-5
        weights = shares[kept] / shares[kept].sum()
        x = engine.track[0]["x"][1:][kept]
        mean = weights @ x
        P = sum(
            w * (engine.covariance(row) + np.outer(one - mean, one - mean))
            for w, row, one in zip(weights, 1 + np.flatnonzero(kept), x, strict=True)
        )
        np.testing.assert_allclose(engine.track[0]["x"][0], mean, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(engine.covariance(), P, rtol=1e-4)


def test_readings_that_come_late_give_the_bits_of_readings_in_order():
    """While nothing is alarming: a verdict is not undone by what comes late."""
    readings = readings_of(measured(120, np.repeat([0.1, 0.13], 60), 4))
    shuffled = readings.copy()
    for at in range(10, 110, 7):
        shuffled[[at, at + 3]] = shuffled[[at + 3, at]]
    found = []
    for one in (readings, shuffled):
        engine = adapted().engine()
        engine.process(one)
        found.append(engine.track[0]["noise"].tobytes() + engine.track[0]["x"].tobytes())
    assert found[0] == found[1]


def test_a_reading_that_the_gate_refuses_still_tells_of_the_noise():
    engine = adapted().engine()
    engine.process(readings_of(measured(200, 0.1, 5)))
    before = engine.track[0]["noise"]["trusted"][0, 0, 0]
    late = readings_of(np.array([40.0]))
    late["t_ns"] += 200 * 100_000_000
    report = engine.process(late)[0]
    assert report["verdict"] == Verdict.GATED
    assert engine.track[0]["noise"]["trusted"][0, 0, 0] > 3.0 * before


def test_what_was_learnt_outlives_a_reset():
    engine = adapted().engine()
    engine.process(readings_of(measured(300, 0.5, 6)))
    ratio = engine.track[0]["noise"]["trusted"][0, 0, 0]
    event = np.zeros(1, adapted().layout.reading)
    event["sensor"], event["t_ns"] = RESET, 300 * 100_000_000
    engine.process(event)
    again = readings_of(measured(1, 0.5, 7))
    again["t_ns"] += 300 * 100_000_000
    assert engine.process(again)[0]["R_used"][0] == pytest.approx(ratio * R)


def test_what_was_learnt_is_kept_across_a_restart(tmp_path):
    first = adapted().engine()
    first.process(readings_of(measured(300, 0.5, 8)))
    kept = tmp_path / "noise.json"
    assert write_noise(kept, learnt(first)) == ""
    known, trouble = read_noise(kept)
    assert trouble == ""

    second = adapted().engine()
    recall(second, known)
    report = second.process(readings_of(measured(1, 0.5, 9)))[0]
    assert report["R_used"][0] == pytest.approx(first.track[0]["noise"]["trusted"][0, 0, 0] * R)
    assert learnt(second)["y1"]["slow"] == pytest.approx(learnt(first)["y1"]["slow"], rel=0.05)


@pytest.mark.parametrize(
    "text", ["not JSON", "[1, 2]", '{"y1": {"trusted": [-1.0], "slow": [1.0]}}', '{"y9": {}}']
)
def test_a_file_of_noise_that_is_none_changes_nothing(tmp_path, text):
    kept = tmp_path / "noise.json"
    kept.write_text(text, encoding="utf-8")
    known, _ = read_noise(kept)
    engine = adapted().engine()
    recall(engine, known)
    assert engine.process(readings_of(measured(1, 0.1, 9)))[0]["R_used"][0] == pytest.approx(R)


def test_a_recording_replays_to_the_same_bits_with_what_was_known_at_its_start(tmp_path):
    known = {"y1": {"trusted": [17.123456789], "slow": [16.5]}}
    readings, path = readings_of(measured(100, 0.4, 10)), tmp_path / "run.mcap"
    digests = []
    with McapWriter(path, adapted().layout, known_noise=known) as writer:
        engine = adapted().engine()
        recall(engine, known)
        digests.append(OutputDigest())
        digests[0].update(engine.process(readings))
        writer.readings(readings)
    log = open_log(path, adapted().layout)
    engine = adapted().engine()
    recall(engine, log.known_noise)
    digests.append(OutputDigest())
    for chunk in log:
        digests[1].update(engine.process(chunk))
    assert digests[0].hexdigest() == digests[1].hexdigest()


@pytest.mark.parametrize("method", ["interacting", "variational", "fuzzy", "fuzzy_additive"])
@pytest.mark.parametrize(
    ("topology", "recursion"),
    [("federated", "ud"), ("information_sum", "ud"), ("stacked", "ud"), ("centralized", "conventional")],
)
def test_every_topology_finds_which_sensor_is_noisy(method, topology, recursion):
    """R of the sensor with five times its declared deviation is found within a third, of the sound within a half."""
    text = text_of(adaptation=f'[adaptation]\nmethod = "{method}"', topology=topology, recursion=recursion)
    assembly = assemble(parse(text, "test"))
    reports = assembly.engine().process(pair_readings(assembly))[400:]
    ratio = reports["R_used"][:, 0] / reports["R_declared"][:, 0]
    assert np.mean(ratio[0::2]) == pytest.approx(1.0, rel=0.5)
    assert np.mean(ratio[1::2]) == pytest.approx(25.0, rel=0.34)


def test_a_local_filter_estimates_from_its_own_innovations():
    text = text_of(adaptation='[adaptation]\nmethod = "variational"', topology="federated")
    assembly = assemble(parse(text, "test"))
    engine = assembly.engine()
    engine.process(pair_readings(assembly))
    trusted = engine.track[0]["noise"]["trusted"]
    assert trusted[1, 1, 0] == pytest.approx(25.0, rel=0.5)
    np.testing.assert_array_equal(trusted[0, :, 0], 1.0)


@pytest.mark.parametrize(
    ("said", "part"),
    [
        ('[adaptation]\nfloor = 1.0\nceiling = 1.0', "no less than the ceiling"),
        ('[adaptation]\nmethod = "fuzzy"\nfuzzy.rules = [["less", "low", "nowhere"]]', "`nowhere` is no set of change"),
        ('[adaptation]\nmethod = "fuzzy"\nfuzzy.rules = [["any", "any", "hold"]]', "asks for nothing"),
        ('[adaptation]\nmethod = "fuzzy"\nfuzzy.mean = { low = [0, 2, 1, 3], high = [2, 3, 5, 5] }', "goes back"),
        ("[adaptation]\nmethod = 3", "adaptation.method"),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_refused_by_name(said, part):
    with pytest.raises(ConfigError, match=part.replace(".", r"\.")):
        assemble(parse(text_of(adaptation=said.replace("[0, 2, 1, 3]", "[0.0, 2.0, 1.0, 3.0]")
                               .replace("[2, 3, 5, 5]", "[2.0, 3.0, 5.0, 5.0]")), "test"))  # fmt: skip


def test_the_floor_is_no_less_than_what_the_resolution_makes():
    text = CONFIG.read_text(encoding="utf-8").replace(
        "resolution = { y = 0.001 }", "resolution = { y = 0.1 }"
    )
    made = assemble(parse(text, "test")).design[0]["noise"]
    assert made["floor"][0, 0] == pytest.approx(0.1**2 / 12.0 / R)
    assert not made["jump"][0, 0, made["level"] < made["floor"][0, 0]].any()


def test_a_run_with_adaptation_is_not_smoothed():
    with pytest.raises(ConfigError, match="--smooth"):
        tracer_of(adapted())
