"""The right to speak: of one daemon alone for good, of one among several by a lease that its loop must renew.

Theory of operation. Several daemons of one configuration hear the same readings and compute the same; one of them
speaks. All that goes out passes `outlet`, which asks the lease each time, so that a daemon which was held up while
another took over is silent before it knows. The others wait longer than a lease lasts: they count from the newest
sign of life that they heard, the holder from its last look, a tenth of a lease after the sign it sent at most.
"""

from __future__ import annotations

from fusiond.service.clock import Clock


class Lease:
    """Whether this daemon may speak, and in which epoch.

    Args:
        epoch: ms since 1970 when it began to speak; later than that of whoever spoke before.
        held: whether it speaks from the start.   clock: by which it runs out; None: it never does.
    """

    def __init__(self, epoch: int = 0, *, held: bool = True, clock: Clock | None = None) -> None:
        self.epoch = epoch
        self.held = held
        self._clock = clock
        self._until_ns: int | None = None

    @property
    def valid(self) -> bool:
        """Whether it may speak now."""
        if self._until_ns is None or self._clock is None:
            return self.held
        return self.held and self._clock.now_ns() <= self._until_ns

    def take(self, epoch: int) -> None:
        """Speak from now on."""
        self.epoch, self.held, self._until_ns = epoch, True, None

    def renew(self, until_ns: int | None) -> None:
        """Speak until then; None: nobody is there to take over, and silence would serve nobody."""
        self._until_ns = until_ns

    def give_up(self) -> None:
        """Be silent from now on."""
        self.held = False
