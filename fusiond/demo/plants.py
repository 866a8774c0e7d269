"""The plants a demonstration can show, and where their configurations are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import fusiond
from fusiond.errors import ConfigError
from fusiond.simulation.faults import parse_faults
from fusiond.simulation.faults_injection import Injection
from fusiond.simulation.rig import PointRig, birotor, minicar

PLANTS: dict[str, Callable[[int], PointRig]] = {
    "birotor": birotor, "birotor_lqg": birotor, "minicar": minicar, "minicar_lqg": minicar,
}  # fmt: skip
TRUTH = ("position", "velocity", "acceleration_bias")
"""What is known of a plant at any time, named after the states of its configuration."""


def rig_of(name: str, seed: int) -> PointRig:
    """A fresh plant with its sensors. Raises: ConfigError."""
    if name not in PLANTS:
        raise ConfigError(f"demo {name}: no plant of that name; choose one of {', '.join(sorted(PLANTS))}")
    return PLANTS[name](seed)


def lying_rig(name: str, seed: int, inject: Sequence[str]) -> PointRig:
    """A fresh plant whose sensors have these faults. Raises: ConfigError."""
    rig = rig_of(name, seed)
    if inject:
        rig.faults = Injection(parse_faults(inject), rig.measured, seed, origin_ns=0)
    return rig


def truth_of(rig: PointRig) -> tuple[float, float, float]:
    """What TRUTH names, now: m, m/s, m/s^2."""
    return rig.state.position_m, rig.state.velocity_m_s, rig.acceleration_bias_m_s2


def config_of(name: str) -> Path:
    """`configs/NAME.toml` here, otherwise beside the package. Raises: ConfigError."""
    folders = [Path("configs"), Path(fusiond.__file__).resolve().parent.parent / "configs"]
    for folder in folders:
        if (folder / f"{name}.toml").is_file():
            return folder / f"{name}.toml"
    tried = " or ".join(str(folder) for folder in dict.fromkeys(folders))
    raise ConfigError(
        f"demo {name}: {name}.toml is not in {tried}; run in the project's folder, or install it editable"
    )
