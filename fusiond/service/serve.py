"""`fusiond run`: a daemon with signals, recording and messages, until it is told to stop."""

from __future__ import annotations

import gc
import signal
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import structlog

from fusiond.recording.background import BackgroundWriter
from fusiond.recording.mcap_writer import McapWriter
from fusiond.service.daemon import Daemon
from fusiond.service.telemetry import Voice

SIGNALS = (signal.SIGTERM, signal.SIGINT)


def serve(
    assembly: Any, *, listen: Sequence[str] = (), connect: Sequence[str] = (), record: Path | None = None,
    on_ready: Callable[[tuple[str, ...]], None], config_text: str = "",
) -> int:  # fmt: skip
    """Run until SIGTERM or SIGINT.

    Args:
        assembly: what to run.      listen, connect: endpoints instead of the configuration's.
        record: file of the daemon's own recording.      config_text: the configuration as TOML, kept in it.
        on_ready: told the endpoints once readings are taken.
    Returns: the exit status: 0, or 1 where the recording is not complete.
    Raises: ConnectionFailed, LogError.
    """
    voice = Voice(structlog.get_logger("fusiond"))
    recorder = None if record is None else BackgroundWriter(McapWriter(record, assembly.layout, config_text))
    daemon = Daemon(assembly, listen=listen, connect=connect, recorder=recorder, voice=voice)
    before = _catch_signals(daemon.stop)
    whole = True
    try:
        on_ready(daemon.startup())
        # What exists now lives as long as the daemon: no collection need look at it again.
        gc.collect()
        gc.freeze()
        daemon.main_loop()
    finally:
        ended = daemon.shutdown()
        if recorder is not None:
            whole = recorder.close(timeout_s=0.6)
            if not whole:
                voice.error(f"recording {record}: not complete, dropped {recorder.dropped} {recorder.error}")
        if not ended:
            voice.error("shutdown: a reader thread did not end; the process ends without it")
        for number, handler in before.items():
            signal.signal(number, handler)
    return 0 if whole else 1


def _catch_signals(stop: Callable[[], None]) -> dict[int, Any]:
    """Let SIGTERM and SIGINT set a flag; returns the handlers before. Elsewhere than in the main thread, nothing."""
    if threading.current_thread() is not threading.main_thread():
        return {}
    return {number: signal.signal(number, lambda *_: stop()) for number in SIGNALS}
