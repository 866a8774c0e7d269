"""Every built-in control law by the `law` a configuration names."""

from __future__ import annotations

from types import ModuleType

from fusiond.control import lqg, lqg_integral, lqr, pd

LAWS: dict[str, ModuleType] = {"pd": pd, "lqr": lqr, "lqg": lqg, "lqg_integral": lqg_integral}
