"""What every test shares: seeded hypothesis, and recordings that may be absent but never silently.

A test that needs a recording says so, and gets its folder:

    @pytest.mark.recordings("jackal")
    def test_the_robot_ends_where_published(recording):
        log = recording("jackal") / "test2.bag"

Where the folder FUSIOND_DATA (default `../shared/data` beside the project) is absent, such a test is skipped
and counted. Where the folder is there, a skip of such a test, for whatever reason, fails the run.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

import fusiond  # noqa: F401  # before numpy is loaded: it keeps BLAS to one thread

PROJECT = Path(__file__).resolve().parent.parent
MARKER = "recordings"
SKIPPED = pytest.StashKey[list[str]]()

# The same examples in every run; no timed assertions, so that a slow machine proves as much as a fast one.
settings.register_profile(
    "fusiond", derandomize=True, deadline=None, database=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("fusiond")


def data_folder() -> Path:
    """Where the recordings are, or would be: FUSIOND_DATA, a relative one counted from the project's root."""
    return (PROJECT / os.environ.get("FUSIOND_DATA", "../shared/data")).resolve()


def in_recordings_room(node: pytest.Item | pytest.Collector) -> bool:
    """Whether a test or a test file lives in the folder of recordings."""
    root = node.config.rootpath
    return node.path.is_relative_to(root) and MARKER in node.path.relative_to(root).parts[:-1]


def needs_recordings(item: pytest.Item) -> bool:
    """Whether a test is marked, asks for the fixture, or lives in the folder of recordings."""
    return (
        item.get_closest_marker(MARKER) is not None
        or "recording" in getattr(item, "fixturenames", ())
        or in_recordings_room(item)
    )


@pytest.fixture
def recording(request: pytest.FixtureRequest) -> Callable[[str], Path]:
    """The folder of a recording, by a name that stands in the test's own mark."""
    named = [name for mark in request.node.iter_markers(MARKER) for name in mark.args]
    assert named, f'{request.node.nodeid}: names no recording; mark it with recordings("NAME", ...)'

    def folder_of(name: str) -> Path:
        assert name in named, f"recording {name}: not in the test's mark ({', '.join(named)}); add it there"
        return data_folder() / name

    return folder_of


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", f"{MARKER}(*names): needs these folders of FUSIOND_DATA")
    config.stash[SKIPPED] = []
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(SkipCounter(config.stash[SKIPPED]))


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip what needs recordings where there are none; fail where only the named one is missing."""
    if not needs_recordings(item):
        return
    root = data_folder()
    if not root.is_dir():
        pytest.skip("needs recordings; FUSIOND_DATA names no folder here")
    names = [name for mark in item.iter_markers(MARKER) for name in mark.args]
    missing = [name for name in names if not (root / name).is_dir()]
    if missing:
        pytest.fail(f"recordings {', '.join(missing)}: not in {root}; correct the name or add the folder")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    """Mark the report of a skip that counts: it may have to travel to the process that counts."""
    report = yield
    if report.skipped and not hasattr(report, "wasxfail") and needs_recordings(item):
        report.user_properties.append((MARKER, item.nodeid))
    return report


class SkipCounter:
    """Counts skips of tests that need recordings, in the process that prints the summary."""

    def __init__(self, skipped: list[str]) -> None:
        self._skipped = skipped

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self._skipped += [str(nodeid) for name, nodeid in report.user_properties if name == MARKER]

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """A whole file of recording tests that skips itself counts as one."""
        inside = MARKER in Path(report.nodeid.split("::")[0]).parts[:-1]
        if report.skipped and inside and report.nodeid not in self._skipped:
            self._skipped.append(report.nodeid)


@pytest.hookimpl(tryfirst=True)
def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    if session.config.stash[SKIPPED] and data_folder().is_dir() and exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    skipped = config.stash[SKIPPED]
    if not data_folder().is_dir():
        terminalreporter.write_line(f"recordings: folder absent, {len(skipped)} skipped that need it")
    elif skipped:
        terminalreporter.write_line(
            f"recordings: folder present, yet {len(skipped)} skipped: the run FAILS", red=True
        )
        for nodeid in skipped:
            terminalreporter.write_line(f"  {nodeid}")
    else:
        terminalreporter.write_line("recordings: folder present, none skipped")
    if started := os.environ.get("FUSIOND_CI_STARTED"):
        terminalreporter.write_line(f"total: {time.time() - float(started):.0f} s since .ci/run began")
