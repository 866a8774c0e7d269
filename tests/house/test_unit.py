"""The systemd unit asks for what the daemon can give, and for nothing that would break it."""

from __future__ import annotations

from pathlib import Path

import pytest

UNIT = Path(__file__).resolve().parents[2] / "packaging" / "fusiond@.service"


def settings() -> dict[str, list[str]]:
    """Every setting of the unit with its values; a setting may be given more than once."""
    found: dict[str, list[str]] = {}
    for line in UNIT.read_text(encoding="utf-8").splitlines():
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
