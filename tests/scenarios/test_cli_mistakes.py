"""What an operator gets wrong at the command line is named at once, with its limit and its remedy."""

from __future__ import annotations

import gzip
import json

import pytest

from fusiond.errors import ConfigError
from fusiond.recording.mcap_blocks import MAGIC
from fusiond.service.endpoints import checked_endpoint
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
    assert err.startswith("service.listen: `tcp/0.0.0.0:70000` has the port `70000` (limit 65535)")


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
