"""A configuration that cannot be run fails at start-up with its remedy."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fusiond.assembly.assembly import assemble
from fusiond.config import parse, read
from fusiond.errors import ConfigError

TEXT = """
name = "cart"
[model]
kind = "driven_point_mass"
bias = true
[initial]
state = { position_m = 0.0 }
std = { position_m = 0.01, velocity_m_s = 0.01, acceleration_bias_m_s2 = 1.0 }
[sensor.accelerometer]
kind = "input"
drives = ["acceleration"]
hold = "previous"
rate_hz = 1000.0
noise_std = { acceleration_m_s2 = 0.01 }
[sensor.sonar]
kind = "direct"
slots = ["position"]
noise_std = { position_m = 0.02 }
[history]
horizon_s = 1.0
[control]
law = "pd"
rate_hz = 100.0
proportional_gain_n_m = 1.0
derivative_gain_n_s_m = 1.0
limit_n = 1.0
reference = { position_m = 2.0 }
"""
SONAR = 'kind = "direct"\nslots = ["position"]\nnoise_std = { position_m = 0.02 }'
ACCELEROMETER = TEXT[TEXT.index("[sensor.accelerometer]") : TEXT.index("[sensor.sonar]")]

MISTAKES = {
    "a kind misspelt": (
        '"direct"',
        '"dircet"',
        "cart.toml: sensor.sonar: no kind `dircet`; did you mean `direct`?",
    ),
    "no kind": ('kind = "direct"', "", "sensor.sonar: `kind` is missing; choose from "),
    "a model misspelt": (
        '"driven_point_mass"',
        '"driven_mass"',
        "model: no kind `driven_mass`; did you mean `driven_point_mass`?",
    ),
    "a law misspelt": ('"pd"', '"pid"', "control: no kind `pid`; did you mean `pd`?"),
    "a key misspelt": ("hold =", "hodl =", "sensor.accelerometer.hodl: unknown key; did you mean `hold`?"),
    "a parameter misspelt": ("bias = true", "bais = true", "model.bais: unknown key; did you mean `bias`?"),
    "a section misspelt": ("[model]", "[modle]", "modle: unknown key; did you mean `model`?"),
    "a key of nowhere": ("bias = true", "zzzzzz = 1", "model.zzzzzz: unknown key; remove it;"),
    "a missing key": ("limit_n = 1.0", "", "control.limit_n: is missing; add it"),
    "a missing name": ('name = "cart"', "", "name: is missing; add it"),
    "a name no key can hold": ('"cart"', '"The Cart"', "name: "),
    "a wrong word": ('"previous"', '"before"', "sensor.accelerometer.hold: "),
    "a number in quotes": ("rate_hz = 1000.0", 'rate_hz = "1000"', "sensor.accelerometer.rate_hz: "),
    "a rate of nothing": ("rate_hz = 1000.0", "rate_hz = 0.0", "sensor.accelerometer.rate_hz: "),
    "a negative time": ("horizon_s = 1.0", "horizon_s = -1.0", "history.horizon_s: "),
    "true for a number": ("limit_n = 1.0", "limit_n = true", "control.limit_n: "),
    "not a number": ("position_m = 0.02", "position_m = nan", "sensor.sonar.noise_std.position_m: "),
    "a negative deviation": (
        "position_m = 0.02",
        "position_m = -0.02",
        "sensor.sonar.noise_std.position_m: ",
    ),
    "a wrong unit": (
        "{ position_m = 0.02 }",
        "{ position_cm = 2.0 }",
        "sensor.sonar.noise_std: unknown `position_cm`; did you mean `position_m`?",
    ),
    "no unit": (
        "{ position_m = 0.02 }",
        "{ position = 0.02 }",
        "sensor.sonar.noise_std: unknown `position`; did you mean `position_m`?",
    ),
    "a wrong unit at the start": (
        "velocity_m_s = 0.01",
        "velocity_km_h = 0.01",
        "initial.std: unknown `velocity_km_h`; did you mean `velocity_m_s`?",
    ),
    "a wrong unit of the goal": (
        "reference = { position_m",
        "reference = { position_cm",
        "control.reference: unknown `position_cm`; did you mean `position_m`?",
    ),
    "no deviation": (
        "noise_std = { position_m = 0.02 }",
        "",
        "sensor.sonar.noise_std: `position_m` is missing;",
    ),
    "two kinds of noise": (
        "[history]",
        "noise_covariance = [[0.1]]\n[history]",
        "sensor.sonar: has noise_std and noise_covariance; keep one of them",
    ),
    "a start half known": (
        ", acceleration_bias_m_s2 = 1.0",
        "",
        "initial.std: `acceleration_bias_m_s2` is missing;",
    ),
    "a state nobody has": (
        '["position"]',
        '["positon"]',
        "sensor.sonar: no state `positon`; the process model has position,",
    ),
    "a sensor of another machine": (
        SONAR,
        'kind = "heading"\nnoise_std = { yaw_rad = 0.1 }',
        "sensor.sonar: no state `yaw`;",
    ),
    "an input nobody has": (
        '["acceleration"]',
        '["speed"]',
        "sensor.accelerometer.drives: the process model has no input `speed`; ",
    ),
    "an input nobody drives": (
        ACCELEROMETER,
        "",
        "model: nothing drives its input `acceleration`; add a sensor",
    ),
    "an input driven twice": (
        "[history]",
        ACCELEROMETER.replace("accelerometer", "second") + "[history]",
        "sensor.second.drives: accelerometer drives `acceleration` too;",
    ),
    "an input that sets nothing": ('["acceleration"]', "[]", "sensor.accelerometer.drives: names no input;"),
    "a sensor that reads nothing": (
        '["position"]',
        "[]",
        "sensor.sonar.slots: [] names no state or one twice;",
    ),
    "a sensor that reads one twice": (
        '["position"]',
        '["position", "position"]',
        "names no state or one twice;",
    ),
    "nothing that corrects": (
        f"[sensor.sonar]\n{SONAR}",
        "",
        "sensor: none corrects the state; add at least one",
    ),
    "nothing that sees": (
        SONAR,
        'kind = "direct"\nslots = ["velocity"]\nnoise_std = { velocity_m_s = 0.1 }',
        "sensor: nothing observes position (rank 2 of 3)",
    ),
    "a range upside down": (
        "[history]",
        "valid = { position_m = [3.0, 1.0] }\n[history]",
        "sensor.sonar.valid.position_m: nothing lies from 3.0 to 1.0;",
    ),
    "a range of one number": (
        "[history]",
        "valid = { position_m = [3.0] }\n[history]",
        "sensor.sonar.valid.position_m: ",
    ),
    "a range of another sensor": (
        "[history]",
        "valid = { range_m = [0.0, 1.0] }\n[history]",
        "sensor.sonar.valid: unknown `range_m`; choose from position_m",
    ),
    "a file nobody has": (
        SONAR,
        'file = "nowhere.py"',
        "sensor.sonar.file: nowhere.py cannot be read (No such file or directory);",
    ),
    "two jumps of a clock": ("horizon_s = 1.0", "resync_count = 1", "history.resync_count: "),
    "not TOML": ("[model]", "model]", "cart.toml: not TOML ("),
}
COVARIANCES = {
    "[[-0.1]]": "has a negative eigenvalue; check",
    "[[0.1, 0.0]]": "is not symmetric 1 x 1;",
    "[]": "is not symmetric 1 x 1;",
}


def refusal(text, folder=Path()):
    with pytest.raises(ConfigError) as told:
        assemble(parse(text, "cart.toml"), folder)
    return str(told.value)


def test_the_configuration_that_the_mistakes_are_made_in_is_sound():
    assert assemble(parse(TEXT, "cart.toml")).layout.numbers == {
        "accelerometer": 0, "applied": 1, "reference": 2, "sonar": 3
    }  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_told_with_its_place_and_its_remedy(mistake):
    old, new, told = MISTAKES[mistake]
    assert TEXT.count(old) >= 1
    assert told in refusal(TEXT.replace(old, new, 1))


@pytest.mark.parametrize("matrix", COVARIANCES)
def test_a_matrix_that_is_no_covariance_is_told(matrix):
    text = TEXT.replace("noise_std = { position_m = 0.02 }", f"noise_covariance = {matrix}")
    assert f"sensor.sonar.noise_covariance: {COVARIANCES[matrix]}" in refusal(text)


def test_every_mistake_is_told_at_once():
    lines = refusal(TEXT.replace("limit_n = 1.0", "").replace("hold =", "hodl =")).splitlines()
    assert len(lines) == 2
    assert all(line.startswith("cart.toml: ") for line in lines)


def test_a_matrix_sensor_says_what_is_wrong_with_it():
    matrix = 'kind = "linear"\nH = [[1.0, 0.0, 0.0]]\nnoise_std = { z0 = 0.1 }'
    assert assemble(parse(TEXT.replace(SONAR, matrix), "x")).layout.sensors[-1].channels[0].key == "z0"
    wrong = {
        "H = []": ("H = [[1.0, 0.0, 0.0]]", "sensor.sonar.H: has no rows;"),
        "H = [[1.0, 0.0]]": (
            "H = [[1.0, 0.0, 0.0]]",
            "sensor.sonar.H: has 1 rows of [2] numbers, needs 1 x 3;",
        ),
        'kind = "linear"\nchannels = ["p", "q"]': (
            'kind = "linear"',
            "sensor.sonar.channels: ['p', 'q'] are not 1",
        ),
    }
    for new, (old, told) in wrong.items():
        assert told in refusal(TEXT.replace(SONAR, matrix.replace(old, new)))


OWN = """
from fusiond.models.contract import Process
from fusiond.types import Slot


def describe(*, walk: float, step_s: float = 0.0) -> Process:
    {body}
"""


@pytest.mark.parametrize(
    ("body", "parameters", "told"),
    [
        (
            "return Process(states=(Slot('x'),), linear=True)",
            "wlak = 1.0",
            "model.wlak: unknown parameter; did you mean `walk`?",
        ),
        (
            "return Process(states=(Slot('x'),), linear=True)",
            "",
            "model.walk: is missing; add it",
        ),
        (
            "return Process(states=(Slot('x'),), linear=True)",
            "walk = 1.0",
            "model: the model file has no function `discretise`;",
        ),
        (
            "return Process(states=(Slot('x'),))",
            "walk = 1.0",
            "model: the model file has no function `transition`;",
        ),
        ("return 1.0 + walk['x']", "walk = 1.0", "model: the model file refuses its parameters ("),
        ("x = (", "walk = 1.0", "model.file: own.py fails on import (SyntaxError:"),
    ],
)
def test_what_is_wrong_with_a_model_of_ones_own_is_told(tmp_path, body, parameters, told):
    (tmp_path / "own.py").write_text(OWN.format(body=body))
    text = re.sub(r'kind = "driven_point_mass"\nbias = true', f'file = "own.py"\n{parameters}', TEXT)
    assert told in refusal(text, tmp_path)


def test_a_file_that_cannot_be_read_is_told(tmp_path):
    with pytest.raises(ConfigError, match=r"nowhere\.toml: cannot be read .*; give the path of a TOML"):
        read(tmp_path / "nowhere.toml")
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="cannot be read"):
        read(tmp_path / "bytes.toml")


def test_a_configuration_does_not_change_after_loading():
    config = parse(TEXT, "x")
    with pytest.raises(ValueError, match="frozen"):
        config.history.horizon_s = 2.0
