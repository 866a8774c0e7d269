"""What an operator gets wrong at the command line is named at once, with its limit and its remedy."""

from __future__ import annotations

import gzip
import json
import re

import pytest

from fusiond.errors import ConfigError
from fusiond.recording.mcap_blocks import MAGIC
from fusiond.service.client import EstimateSubscriber, SensorPublisher
from fusiond.service.endpoints import checked_endpoint
from fusiond.simulation.faults import FORM, Kind
from tests.scenarios.test_cli import CONFIGS, LOG, MINICAR, command, log

__all__ = ["command", "log"]


@pytest.mark.parametrize("content", [b"t_s,sensor,z0\n", b"\x00\x01\x02garbage", b"", MAGIC[:5]])
def test_a_damaged_recording_is_no_csv(command, tmp_path, content):
    run = tmp_path / "run.mcap"
    run.write_bytes(content)
    status, _, err = command("replay", run, MINICAR)
    assert status == 2
    assert "is neither an MCAP recording nor text" in err
    assert "fusiond import" in err


def test_bytes_that_are_no_text_are_no_log_whatever_their_name(command, tmp_path):
    run = tmp_path / "log.csv"
    run.write_bytes(b"\x00\x01\x02\x03" * 100)
    status, _, err = command("replay", run, MINICAR)
    assert status == 2
    assert "neither an MCAP recording nor text" in err


def test_a_packed_csv_is_still_a_log(command, tmp_path):
    packed = tmp_path / "log.csv.gz"
    packed.write_bytes(gzip.compress(LOG.encode()))
    status, out, _ = command("replay", packed, MINICAR, "--json")
    assert (status, json.loads(out)["sensors"]["ultrasonic"]["used"]) == (0, 2)


@pytest.mark.parametrize("words", [("check",), ("run", "--listen", "tcp/127.0.0.1:0")])
def test_a_mapping_file_is_no_configuration(command, words):
    status, _, err = command(words[0], CONFIGS / "import" / "jackal.toml", *words[1:])
    assert status == 2
    assert err.strip().endswith(
        "jackal.toml: is a mapping file of `fusiond import`, no configuration; give the configuration that its log is "
        "meant for"
    )


def test_what_is_neither_keeps_its_own_mistakes(command, tmp_path):
    config = tmp_path / "own.toml"
    config.write_text('name = "own"\n[model]\nkind = "unknown"\n', encoding="utf-8")
    status, _, err = command("check", config)
    assert status == 2
    assert "mapping" not in err


@pytest.mark.parametrize(
    ("endpoint", "fact"),
    [
        ("tcp/127.0.0.1:99999", "the port `99999` (limit 65535)"),
        ("tcp/127.0.0.1:-1", "the port `-1`"),
        ("tcp/127.0.0.1:http", "the port `http`"),
        ("tcp/127.0.0.1:", "the port ``"),
        ("tcp/127.0.0.1", "no HOST:PORT"),
        ("tcp/:7447", "no HOST:PORT"),
        ("tpc/127.0.0.1:7447", "an unknown protocol"),
        ("127.0.0.1:7447", "is no endpoint"),
        ("", "is no endpoint"),
    ],
)
def test_a_wrong_endpoint_is_refused_before_anything_is_opened(command, endpoint, fact):
    """Zenoh would try it until the daemon is stopped."""
    for word in ("--listen", "--connect"):
        status, _, err = command("run", MINICAR, word, endpoint)
        assert status == 2
        assert err.startswith(f"{word}: `{endpoint}`")
        assert fact in err
    status, _, err = command("status", "--connect", endpoint)
    assert (status, err.startswith(f"--connect: `{endpoint}`")) == (2, True)


def test_a_wrong_endpoint_in_the_file_is_named_by_its_key(command, tmp_path):
    config = tmp_path / "far.toml"
    text = MINICAR.read_text(encoding="utf-8")
    config.write_text(text + '\n[service]\nlisten = ["tcp/0.0.0.0:70000"]\n', encoding="utf-8")
    status, _, err = command("run", config)
    assert status == 2
    assert err.startswith(f"{config}: service.listen: `tcp/0.0.0.0:70000` has the port `70000` (limit 65535)")


@pytest.mark.parametrize(
    "endpoint",
    [
        "tcp/127.0.0.1:0", "tcp/127.0.0.1:65535", "tcp/[::1]:7447", "tcp/[fe80::1%eth0]:7447", "tls/robot.local:7447",
        "udp/192.168.0.1:7447?rel=0", "tcp/127.0.0.1:7447#iface=lo", "unixsock-stream/run/fusiond.sock", "ws/*:8000",
    ],
)  # fmt: skip
def test_a_sound_endpoint_is_left_as_it_is(endpoint):
    assert checked_endpoint(endpoint, "--listen") == endpoint


def test_an_endpoint_is_refused_by_its_speaker():
    with pytest.raises(ConfigError, match=r"^service\.connect: "):
        checked_endpoint("tcp/nowhere", "service.connect")


@pytest.mark.parametrize(
    ("old", "new", "fact"),
    [
        ("std = {", "# {", "initial.std: `position_m`, `velocity_m_s`, `acceleration_bias_m_s2` are missing"),
        ("std = {", "covariance = [[1.0, 0.0], [0.0, 1.0]] # {", "initial.covariance: is not 3 x 3"),
        (
            "{ position_m = 0.01 }",
            "{ position_cm = 1.0 }",
            "noise_std: unknown `position_cm`; did you mean `pos",
        ),
        (
            "{ position_m = 0.01 }",
            "{ position_m = nan }",
            "noise_std.position_m: should be a finite number, got n",
        ),
        ("limit_n = 1.0", "limit_n = -1.0", "control.limit_n: should be greater than 0, got -1.0"),
        ("noise_m_s_sqrt_s = 1e-5", "noise_m_s_sqrt_s = -1e-5", "should be greater than or equal to 0"),
        ("[sensor.ultrasonic]", "[sensor.Ultra]", "sensor.Ultra: 'Ultra' is no name; write lower-case"),
        (
            'slots = ["position"]',
            'slots = ["position"]\nkey = "a//b"',
            "sensor.ultrasonic.key: `a//b` is no key",
        ),
        ('name = "minicar"', 'name = "minicar"\nnamespace = "/a"', "namespace: `/a` is no key expression"),
        ('kind = "direct"', 'kind = "gps"', "no kind `gps`; did you mean `gps_course` or `gps_position`?"),
    ],
)
def test_whatever_is_wrong_in_the_file_is_named_with_it(command, tmp_path, old, new, fact):
    """By `check` already, one line, with the file it stands in; none of them ends in a traceback."""
    config = tmp_path / "own.toml"
    text = MINICAR.read_text(encoding="utf-8")
    assert old in text
    config.write_text(text.replace(old, new, 1), encoding="utf-8")
    status, _, err = command("check", config)
    assert status == 2
    assert all(line.startswith(f"{config}: ") for line in err.splitlines())
    assert fact in err


def test_a_mapping_that_does_not_fit_is_named(command, log, tmp_path):
    status, _, err = command("import", log, CONFIGS / "import" / "jackal.toml", tmp_path / "out.mcap")
    assert (status, "jackal.toml: sensor.attitude: " in err) == (2, True)


def test_a_log_without_a_reading_is_no_success(command, log, tmp_path):
    """A recording cut off before its first message replays to nothing, and says so with its status."""
    run = tmp_path / "run.mcap"
    assert command("replay", log, MINICAR, "--out", run)[0] == 0
    run.write_bytes(run.read_bytes()[:60])
    status, out, err = command("replay", run, MINICAR)
    assert (status, "cut short or damaged" in out) == (2, True)
    assert err.startswith(f"{run}: holds no reading")


@pytest.mark.parametrize(
    ("text", "fact"),
    [
        ("t_s,position\n0,1\n\n1,abc\n", "truth.csv: line 4 is not 2 finite numbers"),
        ("t_s,position\n0,1\nnoon,1\n", "truth.csv: line 3 is not 2 finite numbers"),
        ("t_s,position\n0,1,2\n", "truth.csv: line 2 is not 2 finite numbers"),
        ("t_s,postion\n0,1\n", "--truth: has postion, none of which the model has"),
    ],
)
def test_a_truth_that_is_none_is_named_by_its_line(command, log, tmp_path, text, fact):
    truth = tmp_path / "truth.csv"
    truth.write_text(text, encoding="utf-8")
    status, _, err = command("replay", log, MINICAR, "--truth", truth)
    assert status == 2
    assert err.startswith(fact)


def test_a_truth_of_another_time_is_told(command, log, tmp_path):
    truth = tmp_path / "truth.csv"
    truth.write_text("t_s,position\n100,1\n101,1\n", encoding="utf-8")
    status, out, _ = command("replay", log, MINICAR, "--truth", truth)
    assert (status, "truth: covers no moment of the log; compare their times" in out) == (0, True)


@pytest.mark.parametrize(
    ("words", "kind", "fact"),
    [
        ({"connect": ""}, ConfigError, "connect: `` is no endpoint"),
        ({"connect": "tcp/127.0.0.1"}, ConfigError, "connect: `tcp/127.0.0.1` has no HOST:PORT"),
        ({"key": "raw//y1"}, ConfigError, "minicar: y1: `raw//y1` is no key expression"),
        ({"key": "raw/*"}, ConfigError, "is many keys"),
        ({"encoding": "xml"}, ValueError, "encoding 'xml', pack 1; choose json or record"),
        ({"pack": 0}, ValueError, "pack 0; choose json or record, and 1 or more"),
    ],
)
def test_a_publisher_refuses_before_anything_is_opened(words, kind, fact):
    with pytest.raises(kind, match=re.escape(fact)):
        SensorPublisher("minicar", "y1", **words)


def test_a_subscriber_refuses_before_anything_is_opened():
    with pytest.raises(ConfigError, match=r"^connect: `` is no endpoint"):
        EstimateSubscriber("minicar", connect="")


def test_the_help_of_inject_is_whole_on_80_columns(command, monkeypatch):
    """The form of a fault and every kind there is, unbroken."""
    monkeypatch.setenv("COLUMNS", "80")
    for word in ("demo", "replay"):
        _, out, _ = command(word, "--help")
        words = " ".join(out.split())
        assert FORM in out
        assert f"KIND one of {', '.join(Kind)}." in words
