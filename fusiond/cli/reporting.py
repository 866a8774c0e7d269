"""`fusiond report`: recording, truth and page put together."""

from __future__ import annotations

from pathlib import Path

from fusiond.cli.views import working
from fusiond.errors import ConfigError, LogError
from fusiond.recording.mcap_blocks import McapFile
from fusiond.recording.report_run import angles_of, read_run
from fusiond.recording.truth import read_truth


def write_report(run: Path, out: Path, truth: Path | None = None) -> int:
    """Write the report of a run; returns its bytes. Raises LogError, ConfigError.

    Args:
        run: recording of `run --record` or `replay --out`.      truth: CSV, compared with the states it names.
    """
    try:
        from fusiond.cli.report_page import page
    except ImportError as error:
        if (error.name or "").partition(".")[0] != "matplotlib":
            raise
        raise ConfigError(
            "report: matplotlib is not installed, pictures need it; `pip install 'fusiond[report]'`"
        ) from error
    if out.exists() and any(out.samefile(kept) for kept in (run, truth) if kept and kept.exists()):
        raise ConfigError(f"-o: {out} is what the report is made of; name another file")
    known = read_truth(truth, angles_of(McapFile(run))) if truth else None
    with working(f"reading {run.name}"):
        report = read_run(run, known)
    if not report.started:
        raise LogError(
            f"{run.name}: holds ticks and no reading, a picture needs one; record while a sensor sends"
        )
    with working("drawing"):
        content = page(report).encode("utf-8")
    try:
        out.write_bytes(content)
    except OSError as error:
        raise LogError(f"{out}: cannot be written ({error.strerror}); name a writable place") from error
    return len(content)
