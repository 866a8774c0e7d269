"""`fusiond replay`: log, truth and writer put together."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fusiond.assembly.assembly import Assembly
from fusiond.cli.views import counting, working
from fusiond.errors import ConfigError
from fusiond.recording.log import open_log
from fusiond.recording.mcap_writer import McapWriter
from fusiond.recording.replay import replay
from fusiond.recording.truth import read_truth


def replay_log(
    assembly: Assembly, log: Path, *, truth: Path | None, out: Path | None, config_text: str
) -> dict[str, Any]:
    """Replay one log; returns the object of `replay --json`. Raises LogError."""
    if out is not None and out.exists() and log.exists() and out.samefile(log):
        raise ConfigError(f"--out: {out} is the log itself; name another file")
    layout = assembly.layout
    angles = {slot.name for slot in (*layout.states, *layout.outputs) if slot.unit == "rad"}
    source = open_log(log, layout)
    known = read_truth(truth, angles) if truth else None
    writer = McapWriter(out, layout, config_text) if out else None
    try:
        with working("compiling the filter (once for each configuration)"):
            assembly.prepare()
        with counting(f"replay {log.name}") as progress:
            result = replay(
                assembly.engine(),
                source,
                truth=known,
                writer=writer,
                progress=progress,
                refusals=source.refusals,
                estimate_hz=assembly.config.recording.estimate_hz,
            )
    finally:
        if writer is not None:
            writer.close()
    return result.json_object()
