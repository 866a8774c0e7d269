"""`fusiond report`: a run as one page that needs nothing else."""

from __future__ import annotations

import re
import sys
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from fusiond.assembly.assembly import load
from fusiond.cli.replaying import replay_log
from fusiond.cli.reporting import write_report
from fusiond.recording.mcap_writer import McapWriter
from fusiond.recording.report_envelope import Envelope
from fusiond.recording.report_run import read_run
from fusiond.simulation.logs import write_log, write_truth
from fusiond.simulation.registry import simulate
from tests.scenarios.test_cli import MINICAR, command

__all__ = ["command"]

VOID = {"meta", "br", "hr", "img", "link", "input"}


class Page(HTMLParser):
    """A page as lists of tags, attributes and words; fails where an element is not closed in its place."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str]] = []
        self.words = ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.handle_startendtag(tag, attrs)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += [(name, value or "") for name, value in attrs]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words += data


@pytest.fixture(scope="module")
def biased(tmp_path_factory) -> tuple[Path, Path]:
    """A recorded run of 8 s whose ultrasonic sensor says 0.5 m too much from 4 s to 6 s, and its truth."""
    folder = tmp_path_factory.mktemp("report")
    log, truth, run = folder / "log.csv", folder / "truth.csv", folder / "run.mcap"
    simulated = simulate("minicar", seed=0, duration_s=8.0)
    write_log(log, simulated)
    write_truth(truth, simulated.truth)
    text = "# <script>not a tag</script> & more\n" + MINICAR.read_text(encoding="utf-8")
    replay_log(load(MINICAR), log, truth=None, out=run, config_text=text, inject=["ultrasonic.bias=0.5@4+2"])
    return run, truth


@pytest.fixture(scope="module")
def text(biased) -> str:
    run, truth = biased
    write_report(run, run.with_name("out.html"), truth)
    return run.with_name("out.html").read_text(encoding="utf-8")


def test_the_fault_stands_in_picture_and_table_in_words(text, biased):
    """Kind, size with its std and onset, as the recording has them; the size is 0.5 m within 3 sigma."""
    (fault,) = read_run(biased[0]).summaries()["ultrasonic"].faults
    assert abs(fault["size"] - 0.5) < 3 * fault["size_std"]
    size = f"{fault['size']:+.4g} ± {fault['size_std']:.2g} m"
    page = Page(text)
    assert f"1  bias {size}" in page.words
    row = [
        "1",
        "ultrasonic",
        "bias",
        "position",
        *(f"{fault[k]:.3f}" for k in ("onset_s", "detected_s", "cleared_s")),
    ]
    assert "".join([*row, size]) in page.words


def test_every_lane_and_every_part_is_there(text):
    page = Page(text)
    for word in ("service", "accelerometer", "ultrasonic", "nominal", "degraded", "faulty", "gated", "limit", "truth",
                 "R used / R declared", "Commands", "force", "acceleration_bias", "within 3 sigma"):  # fmt: skip
        assert word in page.words, word
    assert page.tags.count("svg") == 5  # time line, states, commands, one sensor, one input
    assert all(colour in text for colour in ("fill: var(--healthy)", "fill: var(--faulty)", "var(--suspect)"))


def test_unix_time_is_told_once_with_its_date(command, tmp_path):
    """Axes and tables count from the first reading; the page says when that was."""
    log, run, out = tmp_path / "log.csv", tmp_path / "run.mcap", tmp_path / "out.html"
    log.write_text(
        "t_s,sensor,z0\n1700000000.0,ultrasonic,0.01\n1700000000.03,ultrasonic,0.01\n", encoding="utf-8"
    )
    command("replay", log, MINICAR, "--out", run)
    assert command("report", run, "-o", out)[0] == 0
    words = Page(out.read_text(encoding="utf-8")).words
    assert "1700000000.000 s, 2023-11-14 22:13:20 UTC" in words
    assert "Times are those of the axis, seconds after the first reading." in words


def test_a_narrow_window_scrolls_its_pictures_and_paper_does_not(text):
    assert "figure { margin: .4rem 0 0; break-inside: avoid; overflow-x: auto }" in text
    assert "svg { width: 100%; min-width: 720px;" in text
    assert "svg { min-width: 0 !important }" in text


def test_the_page_needs_nothing_else(text):
    """No address, no script, no reference but to the page's own identifiers, each given once."""
    page = Page(text)
    assert "://" not in text.replace("<pre>", "")
    assert not {"script", "link", "img", "iframe", "image"} & set(page.tags)
    known = [value for name, value in page.attributes if name == "id"]
    assert len(known) == len(set(known))
    linked = [value for name, value in page.attributes if name == "href"] + re.findall(r"url\((.*?)\)", text)
    assert linked
    assert all(link[0] == "#" and link[1:] in set(known) for link in linked)


def test_what_a_configuration_says_is_text(text):
    assert "<script>" not in text
    assert "# <script>not a tag</script> & more" in Page(text).words


def test_the_same_run_gives_the_same_bytes(text, biased):
    run, truth = biased
    again = run.with_name("again.html")
    write_report(run, again, truth)
    assert again.read_text(encoding="utf-8") == text


def test_a_run_is_drawn_without_truth(command, biased, tmp_path):
    status, out, _ = command("report", biased[0], "-o", tmp_path / "out.html")
    assert status == 0
    assert "out.html" in out
    drawn = (tmp_path / "out.html").read_text(encoding="utf-8")
    Page(drawn)
    assert "var(--truth)" not in drawn


def test_what_is_no_run_is_refused_with_the_remedy(command, tmp_path):
    out = tmp_path / "out.html"
    csv = tmp_path / "log.csv"
    csv.write_text("t_s,sensor,z0\n0.0,ultrasonic,0.1\n", encoding="utf-8")
    empty = tmp_path / "empty.mcap"
    McapWriter(empty, load(MINICAR).layout).close()
    for run, fact in (
        (tmp_path / "none.mcap", "cannot be read"),
        (csv, "is no MCAP"),
        (empty, "holds no reports"),
    ):
        status, _, err = command("report", run, "-o", out)
        assert status == 2
        assert fact in err
        assert not out.exists()


def test_reports_of_another_version_are_named(command, tmp_path):
    """A recording whose reports lack a field says which, and how to make them anew."""
    layout = load(MINICAR).layout
    run = tmp_path / "old.mcap"
    names = [name for name in layout.report.names or () if name != "jump"]
    old = np.zeros(3, [(name, layout.report[name].base, layout.report[name].shape) for name in names])
    with McapWriter(run, layout) as writer:
        writer.reports(old)
    status, _, err = command("report", run, "-o", tmp_path / "out.html")
    assert status == 2
    assert "lack or change jump" in err
    assert "fusiond replay" in err


def test_without_matplotlib_the_remedy_is_named(command, biased, tmp_path, monkeypatch):
    for name in [name for name in sys.modules if name.startswith("fusiond.cli.report_")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.axes", None)
    status, _, err = command("report", biased[0], "-o", tmp_path / "out.html")
    assert status == 2
    assert "pip install 'fusiond[report]'" in err


def test_a_report_is_never_written_over_its_run(command, biased):
    before = biased[0].read_bytes()
    status, _, err = command("report", biased[0], "-o", biased[0])
    assert (status, biased[0].read_bytes()) == (2, before)
    assert "name another file" in err


def test_truth_of_something_else_is_refused(command, biased, tmp_path):
    truth = tmp_path / "truth.csv"
    truth.write_text("t_s,height\n0.0,1.0\n1.0,1.0\n", encoding="utf-8")
    status, _, err = command("report", biased[0], "-o", tmp_path / "out.html", "--truth", truth)
    assert status == 2
    assert "none of which is a state" in err


@pytest.mark.parametrize("block", [1, 7, 1000])
def test_an_envelope_holds_every_extreme_whatever_the_blocks(block):
    """GIVEN 5000 rows over 3 decades of time; THEN each interval has the extremes and the last of its rows."""
    rng = np.random.default_rng(1)
    t_ns = 10**9 + np.cumsum(rng.integers(1, 2_000_000, 5000))
    values = rng.normal(size=(5000, 2))
    values[::17, 1] = np.nan
    envelope = Envelope(2, 64, int(t_ns[0]))
    for start in range(0, len(t_ns), block):
        envelope.add(t_ns[start : start + block], values[start : start + block])
    at = (t_ns - t_ns[0]) // envelope.width_ns
    assert 32 <= at[-1] < 64
    assert envelope.count.sum() == len(t_ns)
    for k in envelope.filled():
        inside = values[at == k]
        assert np.array_equal(envelope.low[k], np.nanmin(inside, axis=0))
        assert np.array_equal(envelope.high[k], np.nanmax(inside, axis=0))
        assert np.array_equal(envelope.last[k], inside[-1], equal_nan=True)
