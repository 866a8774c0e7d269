"""`fusiond record`: listen to a configuration's sensors and write what they send, without an engine."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import structlog

from fusiond.recording.background import BackgroundWriter
from fusiond.recording.mcap_writer import McapWriter
from fusiond.service.clock import Clock
from fusiond.service.intake import Intake
from fusiond.service.mailbox import Arrival, Mailbox
from fusiond.service.sessions import Sessions, open_sessions
from fusiond.service.settings import settings_of
from fusiond.service.signals import stopping_on_signals
from fusiond.service.telemetry import Voice, set_up
from fusiond.service.wire import Decoder, take

JOIN_S = 0.2
LOOK_S = 1.0


def listen_and_record(
    assembly: Any, out: Path, *, listen: Sequence[str] = (), connect: Sequence[str] = (), for_s: float | None = None,
    on_ready: Callable[[tuple[str, ...]], None], config_text: str = "",
) -> int:  # fmt: skip
    """Record until SIGTERM, SIGINT, or for so many seconds.

    Args:
        assembly: whose sensors.      out: file to write, with arrivals, as a daemon records them.
        listen, connect: endpoints instead of the configuration's.
        on_ready: told the endpoints once readings are taken.
    Returns: the exit status: 0, or 1 where the recording is not complete.
    Raises: ConnectionFailed, LogError.
    """
    set_up()
    voice = Voice(structlog.get_logger("fusiond"))
    settings = settings_of(assembly.config, assembly.layout, listen, connect)
    stop = threading.Event()
    with stopping_on_signals(stop.set):
        recorder = BackgroundWriter(McapWriter(out, assembly.layout, config_text))
        decoder, sessions, intake = Decoder(assembly.layout), None, None
        try:
            sessions = open_sessions(
                settings.mode,
                settings.listen,
                settings.connect,
                multicast=settings.multicast,
                give_up=stop.is_set,
            )
            intake = _subscribe(sessions, settings, assembly.layout, decoder, recorder)
            on_ready(sessions.endpoints)
            _wait(stop, for_s, recorder)
        finally:
            if sessions is not None:
                sessions.close()
            if intake is not None:
                intake.join(JOIN_S)
            whole = recorder.close(timeout_s=0.6)
    counts = recorder.writer.counts
    voice.info(f"{out}: {counts['readings']} readings recorded", refused=decoder.refusals.by_name())
    if not whole:
        voice.error(f"{out}: not complete, dropped {recorder.dropped} {recorder.error}")
    return 0 if whole else 1


def _subscribe(
    sessions: Sessions, settings: Any, layout: Any, decoder: Decoder, recorder: BackgroundWriter
) -> Intake:
    """Readers whose work it is to decode what comes and hand it to the recorder."""

    def work(arrivals: list[Arrival]) -> None:
        readings = take(arrivals, intake.sensor_of, decoder)
        if len(readings):
            recorder.put_readings(readings)

    mailbox = Mailbox(settings.ring, work)
    with mailbox.baton:  # until `intake` is there for the work
        intake = Intake(
            sessions.sensors, layout, settings.prefix, settings.keys, settings.ring, mailbox, Clock()
        )
    return intake


def _wait(stop: threading.Event, for_s: float | None, recorder: BackgroundWriter) -> None:
    """Until told to stop, or the time is over, or the recorder cannot go on."""
    left_s = float("inf") if for_s is None else for_s
    while left_s > 0 and not recorder.error and not stop.wait(min(LOOK_S, left_s)):
        left_s -= LOOK_S
