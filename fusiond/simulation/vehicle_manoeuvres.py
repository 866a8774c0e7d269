"""Manoeuvres of a road vehicle: what the steering does over time.

    double lane change   from 1 s on one sine of 2.5 s to the left, a second of straight, the same to the right
    J-turn               from 1 s on a ramp of 0.5 s, then held

Seed 002 drives them with the driver of a commercial simulator and gives no angles. The amplitude is chosen so that a
car of wheelbase L with an understeer gradient of 0.002 rad s^2/m would corner at 4 m/s^2: 4 (L / v^2 + 0.002). It
and the times are those of the recordings `commonroad_maneuvers`, read off their steering.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

WHEELBASE_M = 1.1561957064 + 1.4227170936
CORNERING_M_S2 = 4.0
UNDERSTEER_RAD_S2_M = 0.002
BEGIN_S = 1.0
SINE_S = 2.5
STRAIGHT_S = 1.0
RAMP_S = 0.5


@dataclass(frozen=True, slots=True)
class Manoeuvre:
    """kind: "dlc" or "jturn".   speed_km_h: at the start, and what the driver tries to keep."""

    kind: str
    speed_km_h: float

    @property
    def name(self) -> str:
        """As in `dlc_60kmh`."""
        return f"{self.kind}_{self.speed_km_h:g}kmh"

    @property
    def speed_m_s(self) -> float:
        """The speed in SI."""
        return self.speed_km_h / 3.6

    @property
    def duration_s(self) -> float:
        """Until the car has been straight again, or turning steadily, for a while."""
        return 9.5 if self.kind == "dlc" else 7.0

    @property
    def amplitude_rad(self) -> float:
        """Largest angle of the road wheels."""
        return CORNERING_M_S2 * (WHEELBASE_M / self.speed_m_s**2 + UNDERSTEER_RAD_S2_M)

    def steering_rad(self, t_s: float) -> float:
        """Angle of the road wheels, positive to the left."""
        since_s = t_s - BEGIN_S
        if self.kind == "jturn":
            return self.amplitude_rad * min(max(since_s / RAMP_S, 0.0), 1.0)
        if 0.0 <= since_s < SINE_S:
            return self.amplitude_rad * math.sin(2.0 * math.pi * since_s / SINE_S)
        back_s = since_s - SINE_S - STRAIGHT_S
        if 0.0 <= back_s < SINE_S:
            return -self.amplitude_rad * math.sin(2.0 * math.pi * back_s / SINE_S)
        return 0.0


SEED_002 = (
    *(Manoeuvre("dlc", speed) for speed in (60.0, 90.0, 120.0, 160.0)),
    *(Manoeuvre("jturn", speed) for speed in (60.0, 90.0, 120.0)),
)
"""The seven of the seed."""
