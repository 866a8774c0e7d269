"""Asking a running daemon: `status`, `config`, `command/...`."""

from __future__ import annotations

import json
import time
import uuid
from collections.abc import Mapping
from typing import Any

import zenoh

from fusiond.errors import ConnectionFailed, FusiondError
from fusiond.service.endpoints import checked_endpoint
from fusiond.service.sessions import CONNECT_S, DEFAULT_ENDPOINT, open_session, session_options

TRIES = 4
PAUSE_S = 0.1


class Refused(FusiondError):
    """Raised when the daemon refuses or fails to answer.

    Args:
        code: a word for programs, e.g. `unknown`, `busy`.
    """

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code


def ask(
    name: str | None, what: str, connect: str = DEFAULT_ENDPOINT, *, namespace: str | None = None,
    fields: Mapping[str, Any] | None = None, timeout_s: float = 2.0, session: zenoh.Session | None = None,
) -> Any:  # fmt: skip
    """The daemon's answer.

    Args:
        name: the configuration's; None: whichever daemon answers there.
        what: `status`, `config`, `command/reset`, ...      fields: of the question.
        timeout_s: longest wait for an answer.      session: an open session to share.
    Commands carry an idempotency key of their own, so that asking again never does them twice.
    Raises: ConfigError where `connect` is no endpoint; ConnectionFailed where nobody answers; Refused where the daemon
    says no.
    """
    own = session is None
    checked_endpoint(connect, "--connect")
    session = session or open_session(session_options("client", connect=[connect]), timeout_s=CONNECT_S)
    try:
        question = dict(fields or {})
        if what.startswith("command/"):
            question.setdefault("id", uuid.uuid4().hex)
        prefix = namespace or (f"fusiond/{name}" if name else "fusiond/*")
        answer = _answer(session, f"{prefix}/{what}", json.dumps(question), timeout_s)
    finally:
        if own:
            session.close()
    if answer is None:
        subject = name or "daemon"
        raise ConnectionFailed(
            f"{subject}: nothing answers `{what}` at {connect}; compare the name with that of the running "
            "configuration, or name another endpoint with --connect"
        )
    return answer


def _answer(session: zenoh.Session, key: str, question: str, timeout_s: float) -> Any:
    """The first answer; asked again where there is none, which Zenoh says at once right after connecting."""
    for attempt in range(TRIES):
        if attempt:
            time.sleep(PAUSE_S)
        for reply in session.get(key, payload=question, encoding="application/json", timeout=timeout_s):
            if reply.ok is not None:
                return json.loads(reply.ok.payload.to_bytes())
            if reply.err is not None:
                raise refused(reply.err.payload.to_bytes())
    return None


def refused(payload: bytes) -> Refused:
    """The daemon's refusal as an exception; Zenoh itself answers `Timeout` where the daemon was too slow."""
    try:
        content = json.loads(payload)
        return Refused(str(content["code"]), str(content["message"]))
    except (ValueError, TypeError, KeyError):
        return Refused(
            "timeout", f"daemon: no answer in time ({payload[:40].decode(errors='replace')}); ask again"
        )
