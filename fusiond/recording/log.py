"""A log, whatever its form: opened by what the file is, not by how it is named."""

from __future__ import annotations

from pathlib import Path

from fusiond.engine.layout import Layout
from fusiond.errors import LogError
from fusiond.recording.csv_log import CsvLog
from fusiond.recording.mcap_blocks import MAGIC
from fusiond.recording.mcap_log import McapLog


def open_log(path: Path, layout: Layout) -> CsvLog | McapLog:
    """Open a CSV (also gzipped) or MCAP log: an iterable of reading arrays with `refusals` and `warnings`.

    Raises: LogError where it cannot be read or is neither.
    """
    try:
        with path.open("rb") as file:
            start = file.read(len(MAGIC))
    except OSError as error:
        raise LogError(f"{path}: cannot be read ({error.strerror}); name an existing log") from error
    if start == MAGIC:
        return McapLog(path, layout)
    packed = start.startswith(b"\x1f\x8b")
    if path.suffix == ".mcap" or (b"\0" in start and not packed):
        raise LogError(
            f"{path}: is neither an MCAP recording nor text (it begins with {start!r}); name a whole recording or a "
            "CSV log, or turn the file into one with `fusiond import`"
        )
    return CsvLog(path, layout)
