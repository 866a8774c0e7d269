"""A point plant with its two sensors, stepped by whoever controls it: the offline loop or a live process.

rig = minicar(seed=0)
readings = rig.begin()                 # at t = 0
while ...:
    readings = rig.advance(force_n)    # one millisecond later
"""

from __future__ import annotations

from dataclasses import dataclass, field

from fusiond.simulation import sensors
from fusiond.simulation.plants import BI_ROTOR, MINI_CAR, PointPlant, PointState
from fusiond.simulation.tables import Reading
from fusiond.types import NANOSECONDS

STEP_NS = 1_000_000


@dataclass(slots=True)
class PointRig:
    """The plant's truth and clock, and the sensors on board. The same seed and forces give the same bits."""

    plant: PointPlant
    accelerometer: sensors.Sensor[PointState]
    ultrasonic: sensors.Sensor[PointState]
    t_ns: int = 0
    state: PointState = field(init=False)

    def __post_init__(self) -> None:
        self.state = self.plant.start

    @property
    def acceleration_bias_m_s2(self) -> float:
        """What the accelerometer adds in this run."""
        return self.accelerometer.bias[0]

    def begin(self) -> list[Reading]:
        """The readings at t = 0: position only, for no millisecond has passed to have a mean acceleration."""
        return [self.ultrasonic.read(0, self.state)]

    def advance(self, force_n: float) -> list[Reading]:
        """Hold the force for one millisecond; the readings stamped with its end, in order of their names."""
        self.state = self.plant.advance(self.state, force_n, STEP_NS / NANOSECONDS)
        self.t_ns += STEP_NS
        on_board = (self.accelerometer, self.ultrasonic)
        return [sensor.read(self.t_ns, self.state) for sensor in on_board if sensor.is_due(self.t_ns)]


def minicar(seed: int, **accelerometer: float) -> PointRig:
    """Seed 000, example 1. Keywords go to `sensors.accelerometer`."""
    return PointRig(MINI_CAR, sensors.accelerometer(seed, **accelerometer), sensors.ultrasonic(seed))


def birotor(seed: int, **accelerometer: float) -> PointRig:
    """Seed 000, example 2. Keywords go to `sensors.accelerometer`."""
    return PointRig(BI_ROTOR, sensors.accelerometer(seed, **accelerometer), sensors.ultrasonic(seed))
