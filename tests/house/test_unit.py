"""The systemd unit asks for what the daemon can give, and for nothing that would break it."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

PACKAGING = Path(__file__).resolve().parents[2] / "packaging"
UNIT, STANDBY = PACKAGING / "fusiond@.service", PACKAGING / "standby.conf"


def settings(path: Path = UNIT) -> dict[str, list[str]]:
    """Every setting of a unit with its values; a setting may be given more than once."""
    found: dict[str, list[str]] = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        if "=" in line and not line.startswith("#"):
            key, _, value = line.partition("=")
            found.setdefault(key, []).append(value)
    return found


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("Type", "notify"),
        ("NotifyAccess", "main"),
        ("Restart", "on-failure"),
        ("RestartPreventExitStatus", "2"),
        ("DynamicUser", "yes"),
        ("ProtectSystem", "strict"),
        ("NoNewPrivileges", "yes"),
    ],
)
def test_the_promised_settings_are_there(key, value):
    assert settings()[key] == [value]


def test_the_cache_the_daemon_is_told_of_is_the_one_systemd_makes():
    told = next(
        v.removeprefix("FUSIOND_CACHE=") for v in settings()["Environment"] if v.startswith("FUSIOND_CACHE=")
    )
    assert told == f"%C/{settings()['CacheDirectory'][0]}"


def test_compiled_code_may_be_written_and_executed():
    assert "MemoryDenyWriteExecute" not in settings()


def test_zenoh_and_the_notification_have_their_sockets():
    assert {"AF_INET", "AF_INET6", "AF_NETLINK", "AF_UNIX"} <= set(
        settings()["RestrictAddressFamilies"][0].split()
    )


def test_the_first_start_has_time_to_compile():
    """A cold start may take 15 s; a machine several times slower must still come up."""
    assert float(settings()["TimeoutStartSec"][0]) >= 60


def test_the_standby_is_another_rank_of_the_same_configuration_with_folders_of_its_own():
    """What it lays over the unit: an empty value takes the unit's away, where one would be added to it."""
    unit, standby = settings(), settings(STANDBY)
    assert standby["ExecStart"] == ["", f"{unit['ExecStart'][0]} --rank 1"]
    for folder in ("StateDirectory", "CacheDirectory"):
        assert standby[folder][0] == ""
        assert standby[folder][1:] != unit[folder]
    assert standby["WorkingDirectory"] == [f"%S/{standby['StateDirectory'][1]}"]
    assert standby["Environment"] == [f"FUSIOND_CACHE=%C/{standby['CacheDirectory'][1]}"]


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd here")
@pytest.mark.parametrize("name", ["fusiond", "fusiond-standby"])
def test_systemd_takes_the_units(name, tmp_path):
    """As they are installed, but for the program, which is not."""
    programs = [settings()["ExecStart"][0].split()[0], "/bin/true"]
    unit = tmp_path / f"{name}@.service"
    unit.write_text(UNIT.read_text(encoding="utf-8").replace(*programs), encoding="utf-8")
    if name == "fusiond-standby":
        over = tmp_path / f"{name}@.service.d" / STANDBY.name
        over.parent.mkdir()
        over.write_text(STANDBY.read_text(encoding="utf-8").replace(*programs), encoding="utf-8")
    command = ["systemd-analyze", "verify", "--man=no", str(tmp_path / f"{name}@minicar.service")]
    found = subprocess.run(
        command,
        check=False,
        env={**os.environ, "SYSTEMD_UNIT_PATH": f"{tmp_path}:"},
        capture_output=True,
        text=True,
    )
    assert (found.returncode, found.stdout, found.stderr) == (0, "", "")
