"""A point plant with its two sensors, stepped by whoever controls it: the offline loop or a live process.

rig = minicar(seed=0)
readings = rig.begin()                 # at t = 0
while ...:
    readings = rig.advance(force_n)    # one millisecond later
"""

from __future__ import annotations

from dataclasses import dataclass, field

from fusiond.simulation import sensors
from fusiond.simulation.faults_injection import Injection, Measured
from fusiond.simulation.plants import BI_ROTOR, MINI_CAR, PointPlant, PointState
from fusiond.simulation.tables import Reading
from fusiond.types import NANOSECONDS

STEP_NS = 1_000_000
DRIVEN = tuple(Measured(name, 1, sigma=(0.0,)) for name in ("applied", "reference"))
"""What is sent beside measurements: exact, a force in N and a goal in m."""


@dataclass(slots=True)
class PointRig:
    """The plant's truth and clock, and the sensors on board. The same seed and forces give the same bits.

    faults: what the sensors make of their readings before they send them, None where they are honest.
    """

    plant: PointPlant
    accelerometer: sensors.Sensor[PointState]
    ultrasonic: sensors.Sensor[PointState]
    t_ns: int = 0
    faults: Injection | None = None
    state: PointState = field(init=False)

    def __post_init__(self) -> None:
        self.state = self.plant.start

    @property
    def acceleration_bias_m_s2(self) -> float:
        """What the accelerometer adds in this run."""
        return self.accelerometer.bias[0]

    def begin(self) -> list[Reading]:
        """The readings at t = 0: position only, for no millisecond has passed to have a mean acceleration."""
        return self.tell([self.ultrasonic.read(0, self.state)])

    def advance(self, force_n: float) -> list[Reading]:
        """Hold the force for one millisecond; the readings stamped with its end, in order of their names."""
        self.state = self.plant.advance(self.state, force_n, STEP_NS / NANOSECONDS)
        self.t_ns += STEP_NS
        on_board = (self.accelerometer, self.ultrasonic)
        due = [sensor for sensor in on_board if sensor.is_due(self.t_ns)]
        return self.tell([sensor.read(self.t_ns, self.state) for sensor in due])

    def tell(self, readings: list[Reading]) -> list[Reading]:
        """What is sent of these readings, lies included; what drives the plant (`applied`) may pass here too."""
        return readings if self.faults is None else self.faults.tell(readings)

    @property
    def measured(self) -> tuple[Measured, ...]:
        """What there is to lie about."""
        return self.accelerometer.measured, self.ultrasonic.measured, *DRIVEN


def minicar(seed: int, **accelerometer: float) -> PointRig:
    """Seed 000, example 1. Keywords go to `sensors.accelerometer`."""
    return PointRig(MINI_CAR, sensors.accelerometer(seed, **accelerometer), sensors.ultrasonic(seed))


def birotor(seed: int, **accelerometer: float) -> PointRig:
    """Seed 000, example 2. Keywords go to `sensors.accelerometer`."""
    return PointRig(BI_ROTOR, sensors.accelerometer(seed, **accelerometer), sensors.ultrasonic(seed))
