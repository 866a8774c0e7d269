"""Levels of the command: what is commanded while the estimate is how it is.

    level            while                                                          command              valid
    nominal          every sensor is sound                                          the law's            yes
    degraded         some sensor is not used, the others correct the state          the law's            yes
    dead_reckoning   nothing has corrected the state, not for too long yet          the law's            yes
    safe             the state is invalid or not finite, dead reckoning took too    the safe one         no
                     long, no sound sensor has corrected it for too long, a
                     deviation is too large, there is no reference, or the
                     service missed its deadline

The first three are the service's health (`types.ServiceHealth`); whatever happens, `safe` is one step away and is left
as soon as its reason is gone. The safe command, of which the configuration chooses the mode:

    hold    the last command stands
    zero    the safe command at once
    ramp    from the last command to the safe one in a given time, in a straight line
"""

from __future__ import annotations

from fusiond.numerics.kernel import kernel
from fusiond.types import Label, ServiceHealth


class Level(Label):
    """Level of a command; the first three have the numbers of the service's health."""

    NOMINAL = 0
    DEGRADED = 1
    DEAD_RECKONING = 2
    SAFE = 3


class Safe(Label):
    """What the safe command is."""

    HOLD = 0
    ZERO = 1
    RAMP = 2


HOLD, RAMP = int(Safe.HOLD), int(Safe.RAMP)
SAFE = int(Level.SAFE)
RECKONING, INVALID = int(ServiceHealth.DEAD_RECKONING), int(ServiceHealth.INVALID)


@kernel
def level_of(service: int, has_reference: bool, trusted: bool, reckoned_ns: int, patience_ns: int) -> int:
    """The level of a command.

    Args:
        service: health of the service, of a state that is finite.   trusted: no deviation is too large, and a sound
        sensor has corrected the state not too long ago.
        reckoned_ns: how long dead reckoning has lasted.   patience_ns: how long it may.
    """
    if service == INVALID or not has_reference or not trusted:
        return SAFE
    if service == RECKONING and reckoned_ns > patience_ns:
        return SAFE
    return service


@kernel
def safe_command(mode: int, last: float, begun: float, safe: float, since_ns: int, ramp_ns: int) -> float:
    """One number of the safe command.

    Args:
        last: the command before.   begun: the last one before safety.   safe: the configured one.
        since_ns: time in safety.   ramp_ns: time the ramp takes.
    """
    if mode == HOLD:
        return last
    if mode == RAMP and since_ns < ramp_ns:
        return begun + (safe - begun) * (since_ns / ramp_ns)
    return safe
