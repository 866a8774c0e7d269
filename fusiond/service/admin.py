"""Questions and commands: queryables `status`, `config`, `command/...`, answered by the loop that owns the state.

A query waits in a thread of its own, never in Zenoh's: it is handed to the loop, and the answer is sent from here,
so that a slow asker holds up nobody but other askers. To add a question is one entry in the answers.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from concurrent.futures import TimeoutError as TooSlow
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from typing import Any

import zenoh

from fusiond.service.messages import dumps

MOST_WAITING = 64
ANSWER_S = 1.0
"""Longest wait for the loop; after it the asker is told that the loop is busy."""
REMEMBERED_COMMANDS = 1024
OCTETS = "application/octet-stream"


class Refusal(Exception):
    """Raised by an answer to refuse; becomes `{"code", "message"}` at the asker.

    Args:
        code: a word for programs.      message: `subject: fact, remedy`.
    """

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code


Answer = Callable[[Mapping[str, Any]], Any]
"""From what was asked (parameters, fields of the payload) to something JSON can say, or bytes. Raises Refusal."""


@dataclass(slots=True)
class Question:
    """One question on its way to the loop."""

    what: str
    asked: Mapping[str, Any]
    answer: Future[Any] = field(default_factory=Future)


class Admin:
    """The queryables of one daemon.

    Args:
        session: answers.      prefix: the namespace.
        answers: by key under the prefix; those under `command/` are done once for each idempotency key (`id`).
        wake: called after a question was handed over.   open: whether it takes questions from the start.
    """

    def __init__(
        self, session: zenoh.Session, prefix: str, answers: Mapping[str, Answer], wake: Callable[[], None],
        *, open: bool = True,
    ) -> None:  # fmt: skip
        self._prefix = prefix
        self._answers = dict(answers)
        self._wake = wake
        self._queries: SimpleQueue[zenoh.Query | None] = SimpleQueue()
        self._questions: SimpleQueue[Question] = SimpleQueue()
        self._done: dict[str, Any] = {}
        self._thread = threading.Thread(target=self._work, name="admin", daemon=True)
        self._thread.start()
        self._keys = sorted({what if "/" not in what else what.partition("/")[0] + "/*" for what in answers})
        self._session = session
        self._queryables: list[zenoh.Queryable[Any]] = []
        if open:
            self.open()

    def open(self) -> None:
        """Take questions from now on."""
        # A direct callback only appends to a queue; a channel that fills up would stop its link.
        handler = zenoh.handlers.Callback(self._take, indirect=False)
        self._queryables += [
            self._session.declare_queryable(f"{self._prefix}/{key}", handler, complete=True)
            for key in self._keys
        ]

    def withdraw(self) -> None:
        """Take no more questions."""
        while self._queryables:
            self._queryables.pop().undeclare()

    def answer_pending(self, most: int = 4) -> None:
        """Answer what waits, at most so many; called by the loop."""
        for _ in range(min(self._questions.qsize(), most)):
            try:
                question = self._questions.get_nowait()
            except Empty:
                return
            if not question.answer.set_running_or_notify_cancel():
                continue
            try:
                question.answer.set_result(self._answer(question))
            except Exception as error:
                question.answer.set_exception(error)

    def close(self, timeout_s: float) -> bool:
        """End the thread, after its session was closed. False where it did not."""
        self._queries.put(None)
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _take(self, query: zenoh.Query) -> None:
        if self._queries.qsize() < MOST_WAITING:
            self._queries.put(query)
        else:
            query.drop()

    def _work(self) -> None:
        while (query := self._queries.get()) is not None:
            with query:
                try:
                    self._reply(query)
                except zenoh.ZError:
                    # The asker has gone, or the session was closed under us: nobody is left to tell.
                    continue

    def _reply(self, query: zenoh.Query) -> None:
        try:
            what = self._what(str(query.key_expr))
            question = Question(what, asked_of(query))
            self._questions.put(question)
            self._wake()
            answer = question.answer.result(ANSWER_S)
        except Refusal as refusal:
            refuse(query, refusal.code, str(refusal))
        except TooSlow:
            question.answer.cancel()
            refuse(query, "busy", f"loop: no answer within {ANSWER_S:g} s; ask again, or look at its queue")
        except Exception as error:
            refuse(query, "failed", f"{type(error).__name__}: {error}")
        else:
            packed = isinstance(answer, bytes)
            payload, encoding = (answer, OCTETS) if packed else (dumps(answer), "application/json")
            query.reply(f"{self._prefix}/{what}", payload, encoding=encoding)

    def _what(self, key: str) -> str:
        """What a query's key asks for; a wildcard asks for the one question it can mean."""
        wanted = zenoh.KeyExpr(key)
        found = [what for what in self._answers if wanted.intersects(zenoh.KeyExpr(f"{self._prefix}/{what}"))]
        if "*" in key:
            found = [what for what in found if not what.startswith("command/")]
        if len(found) != 1:
            known = ", ".join(sorted(self._answers))
            raise Refusal("unknown", f"{key}: means {len(found)} things; ask for one of {known}")
        return found[0]

    def _answer(self, question: Question) -> Any:
        identity = question.asked.get("id")
        if not question.what.startswith("command/") or identity is None:
            return self._answers[question.what](question.asked)
        key = f"{question.what} {identity}"
        if key in self._done:
            return self._done[key] | {"repeated": True}
        answer = self._done[key] = self._answers[question.what](question.asked)
        while len(self._done) > REMEMBERED_COMMANDS:
            del self._done[next(iter(self._done))]
        return answer


def asked_of(query: zenoh.Query) -> dict[str, Any]:
    """Parameters (`?a=1;b=2`) and the JSON object of the payload, if any. Raises: Refusal."""
    asked: dict[str, Any] = dict(
        part.partition("=")[::2] for part in str(query.parameters).split(";") if part
    )
    payload = b"" if query.payload is None else query.payload.to_bytes()
    if not payload:
        return asked
    try:
        found = json.loads(payload)
    except (ValueError, RecursionError) as error:
        raise Refusal("malformed", "payload: is no JSON; send an object, or nothing") from error
    if not isinstance(found, dict):
        raise Refusal("malformed", "payload: is no JSON object; send an object, or nothing")
    return asked | found


def refuse(query: zenoh.Query, code: str, message: str) -> None:
    """Answer with an error."""
    query.reply_err(dumps({"code": code, "message": message}), encoding="application/json")
