"""SIGTERM and SIGINT: they set a flag; only while nothing can look at it do they interrupt."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

NUMBERS = (signal.SIGTERM, signal.SIGINT)


class Interrupted(BaseException):
    """Raised by a signal that comes while the daemon prepares: a compilation looks at no flag.

    No `Exception`, so that nothing on the way takes it for a failure of its own.
    """


@contextmanager
def stopping_on_signals(
    stop: Callable[[], None], preparing: Callable[[], bool] = lambda: False
) -> Iterator[None]:
    """Call `stop` on SIGTERM and SIGINT; elsewhere than in the main thread, change nothing.

    Args:
        stop: sets a flag; must be allowed in a signal handler.
        preparing: whether nobody looks at the flag now, so that the signal must interrupt.
    """

    def handle(*_: Any) -> None:
        stop()
        if preparing():
            raise Interrupted

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, handle) for number in NUMBERS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
