"""`fusiond run`: a daemon with signals, recording and messages, until it is told to stop."""

from __future__ import annotations

import gc
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import structlog

from fusiond.recording.background import BackgroundWriter
from fusiond.recording.mcap_writer import McapWriter, keep_existing
from fusiond.service.daemon import Daemon
from fusiond.service.noise_file import noise_file, read_noise, write_noise
from fusiond.service.signals import Interrupted, stopping_on_signals
from fusiond.service.telemetry import Voice, set_up

RECORD_S = 0.6
"""Time the recording has to finish: a stop takes less than a second in all."""


def serve(
    assembly: Any, *, listen: Sequence[str] = (), connect: Sequence[str] = (), record: Path | None = None,
    on_ready: Callable[[tuple[str, ...]], None], config_text: str = "", rank: int | None = None,
) -> int:  # fmt: skip
    """Run until SIGTERM or SIGINT.

    Args:
        assembly: what to run.      listen, connect: endpoints instead of the configuration's.
        record: file of the daemon's own recording.      config_text: the configuration as TOML, kept in it.
        rank: in a group of daemons, instead of the configuration's.
        on_ready: told the endpoints once readings are taken.
    Returns: the exit status: 0, or 1 where the recording is not complete.
    Raises: ConnectionFailed, LogError.
    """
    set_up()
    voice = Voice(structlog.get_logger("fusiond"))
    if record is not None and (aside := keep_existing(record)) is not None:
        voice.info(f"recording: {record} was there; it is now {aside}")
    kept = noise_file() if assembly.layout.shape.adapt is not None else None
    known, trouble = read_noise(kept)
    if trouble:
        voice.info(trouble)
    recorder = None
    if record is not None:
        recorder = BackgroundWriter(McapWriter(record, assembly.layout, config_text, known_noise=known))
    daemon = Daemon(
        assembly, listen=listen, connect=connect, recorder=recorder, voice=voice, known_noise=known, rank=rank
    )
    whole = True
    with stopping_on_signals(daemon.stop, lambda: daemon.preparing):
        try:
            on_ready(daemon.startup())
            # What exists now lives as long as the daemon: no collection need look at it again.
            gc.collect()
            gc.freeze()
            daemon.main_loop()
        except Interrupted:
            voice.info("stopped before it was ready")
        finally:
            whole = _end(daemon, recorder, voice)
            if trouble := write_noise(kept, daemon.learnt_noise()):
                voice.error(trouble)
    return 0 if whole else 1


def _end(daemon: Daemon, recorder: BackgroundWriter | None, voice: Voice) -> bool:
    """Close everything; whether the recording, if any, is complete."""
    if not daemon.shutdown():
        voice.error("shutdown: a reader thread did not end; the process ends without it")
    if recorder is None or recorder.close(timeout_s=RECORD_S):
        return True
    voice.error(f"recording: not complete, dropped {recorder.dropped} {recorder.error}")
    return False
