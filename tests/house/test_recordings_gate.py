"""A recording that is there is used, one that is absent is counted: the rules of tests/conftest.py."""

from __future__ import annotations

from pathlib import Path

import pytest

CONFTEST = (Path(__file__).resolve().parent.parent / "conftest.py").read_text(encoding="utf-8")
USES_JACKAL = """
    import pytest

    @pytest.mark.recordings("jackal")
    def test_needs_it(recording):
        assert recording("jackal").is_dir()

    def test_needs_nothing():
        pass
"""


@pytest.fixture
def run(pytester, monkeypatch):
    """Run a test file under the project's conftest, with the given recordings present (None: no folder)."""
    pytester.makeconftest(CONFTEST)

    def run_with(source: str, present: list[str] | None) -> pytest.RunResult:
        data = pytester.path / "data"
        for name in present or []:
            (data / name).mkdir(parents=True)
        monkeypatch.setenv("FUSIOND_DATA", str(data))
        monkeypatch.setenv("FUSIOND_CI_STARTED", "0")
        pytester.makepyfile(source)
        return pytester.runpytest("-p", "no:cacheprovider")

    return run_with


def test_present_recordings_are_used(run):
    result = run(USES_JACKAL, ["jackal"])
    result.assert_outcomes(passed=2)
    assert result.ret == 0


def test_absent_folder_skips_and_counts(run):
    result = run(USES_JACKAL, None)
    result.assert_outcomes(passed=1, skipped=1)
    assert result.ret == 0
    result.stdout.fnmatch_lines(["recordings: folder absent, 1 skipped that need it"])


def test_missing_recording_in_a_present_folder_fails(run):
    result = run(USES_JACKAL, ["dresden_car"])
    result.assert_outcomes(passed=1, errors=1)
    assert result.ret == 1


def test_a_skip_with_the_folder_present_fails_the_run(run):
    result = run(
        """
        import pytest

        @pytest.mark.recordings("jackal")
        def test_lazy():
            pytest.skip("not today")
        """,
        ["jackal"],
    )
    result.assert_outcomes(skipped=1)
    assert result.ret == 1
    result.stdout.fnmatch_lines(["*1 skipped: the run FAILS*", "*test_lazy"])


def test_an_unrelated_skip_does_not_fail_the_run(run):
    result = run("import pytest\n\ndef test_other():\n    pytest.skip('elsewhere')\n", ["jackal"])
    result.assert_outcomes(skipped=1)
    assert result.ret == 0


def test_the_fixture_refuses_a_test_that_is_not_marked(run):
    result = run("def test_unmarked(recording):\n    pass\n", ["jackal"])
    result.assert_outcomes(errors=1)


def test_the_fixture_refuses_a_recording_that_the_mark_leaves_out(run):
    source = USES_JACKAL.replace('recording("jackal").is_dir()', 'recording("plaza")')
    run(source, ["jackal"]).assert_outcomes(passed=1, failed=1)


def test_the_closing_line_of_pytest_stays_the_last(run):
    """CI reads the counts from it, so our own lines come before."""
    lines = [line for line in run(USES_JACKAL, ["jackal"]).outlines if line.strip()]
    assert "2 passed" in lines[-1]
    assert any(line.startswith("total: ") for line in lines[:-1])


def test_a_file_of_recording_tests_that_skips_itself_fails_the_run(pytester, monkeypatch):
    pytester.makeconftest(CONFTEST)
    (pytester.path / "data").mkdir()
    monkeypatch.setenv("FUSIOND_DATA", str(pytester.path / "data"))
    room = pytester.mkdir("recordings")
    (room / "test_whole.py").write_text("import pytest\n\npytest.skip('all', allow_module_level=True)\n")
    (pytester.path / "test_other.py").write_text("def test_other():\n    pass\n")
    assert pytester.runpytest("-p", "no:cacheprovider").ret == 1
