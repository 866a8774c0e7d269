"""How each named system becomes readings and truth. Keyword-only parameters are the options of `simulate`.

`lies` makes the faults of its sensors, once it has said which it has; by default they are honest.

Which interval a reading that is an input describes: `accelerometer` and `speed` the one that ends at its
stamp, `applied` the one that begins there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fusiond.simulation import closed_loop, options, rig, sensors
from fusiond.simulation.arrivals import stamp_order
from fusiond.simulation.faults_injection import Injection, Measured
from fusiond.simulation.linear_plants import ConstantVelocityPlant, ReferencePlant
from fusiond.simulation.planar import PlanarState, PlanarVehicle
from fusiond.simulation.plants import PointState, wall_robot_position
from fusiond.simulation.square_robot import Sensors as SquareSensors
from fusiond.simulation.square_robot import run as run_square
from fusiond.simulation.streams import stream
from fusiond.simulation.tables import Floats, Reading, Times, Truth, stamps
from fusiond.simulation.vehicle_drive import follow
from fusiond.simulation.vehicle_equations import COLUMNS
from fusiond.simulation.vehicle_manoeuvres import Manoeuvre
from fusiond.simulation.vehicle_sensors import MEASURED, MILLISECOND_NS
from fusiond.simulation.vehicle_sensors import readings as vehicle_readings
from fusiond.types import NANOSECONDS

Made = tuple[list[Reading], Truth]
Lies = Callable[[Sequence[Measured]], Injection]
Feedbacks = dict[str, Callable[[PointState], closed_loop.Feedback]]
FEEDBACKS: Feedbacks = {
    "ideal": lambda start: closed_loop.ideal(),
    "accelerometer": closed_loop.accelerometer_only,
    "ultrasonic": closed_loop.ultrasonic_only,
}


def honest(measured: Sequence[Measured]) -> Injection:
    """No faults."""
    return Injection((), measured)


def minicar(
    seed: int,
    duration_ns: int,
    lies: Lies = honest,
    *,
    feedback: str = "ideal",
    goal_m: float = 2.0,
    inputs: bool = False,
) -> Made:
    """Seed 000, example 1.

    feedback: ideal (the true state, so that the log owes nothing to a filter), accelerometer or ultrasonic.
    inputs: add `applied` rows (the force, N, held from the stamp on) and one `reference` row (the goal, m).
    """
    return _point(rig.minicar(seed), duration_ns, lies, feedback, goal_m, inputs)


def birotor(
    seed: int,
    duration_ns: int,
    lies: Lies = honest,
    *,
    feedback: str = "ideal",
    goal_m: float = 0.75,
    inputs: bool = False,
) -> Made:
    """Seed 000, example 2; options as for the mini car. Its accelerometer measures z'' + bias (`sensors`)."""
    return _point(rig.birotor(seed), duration_ns, lies, feedback, goal_m, inputs)


def _point(
    plant_rig: rig.PointRig, duration_ns: int, lies: Lies, feedback: str, goal_m: float, inputs: bool
) -> Made:
    plant_rig.faults = lies(plant_rig.measured)
    source = FEEDBACKS[options.choice("feedback", feedback, tuple(FEEDBACKS))](plant_rig.plant.start)
    law = closed_loop.PdLaw(options.number("goal_m", goal_m), plant_rig.plant.weight_n)
    loop = closed_loop.run(plant_rig, law, source, duration_ns)
    readings = list(loop.readings)
    if options.flag("inputs", inputs):
        readings.extend(plant_rig.tell([Reading(0, "reference", (law.goal_m,))]))
        forces = zip(loop.t_ns.tolist(), loop.force_n.tolist(), strict=True)
        readings.extend(plant_rig.tell([Reading(t, "applied", (u,)) for t, u in forces]))
    bias = np.full(loop.t_ns.size, plant_rig.acceleration_bias_m_s2)
    names = ("position", "velocity", "acceleration_bias", "acceleration", "force")
    columns = (loop.states[:, 0], loop.states[:, 1], bias, loop.states[:, 2], loop.force_n)
    return readings, Truth(loop.t_ns, names, np.column_stack(columns))


def wall_robot(seed: int, duration_ns: int, lies: Lies = honest) -> Made:
    """Seed 001: x = 0.05 t cos 2t every 0.1 s.

    `speed` is the mean velocity over the 0.1 s that end at its stamp, 0 at t = 0, plus noise; the truth's
    `velocity` is the same mean without the noise.
    """
    period_ns = 100_000_000
    t_ns = stamps(duration_ns, period_ns)
    position = wall_robot_position(t_ns / NANOSECONDS)
    mean_velocity = np.diff(position, prepend=position[0]) * (NANOSECONDS / period_ns)
    truth = Truth(t_ns, ("position", "velocity"), np.column_stack((position, mean_velocity)))
    aboard = (sensors.speedometer(seed), sensors.range_finder(seed))
    readings = [
        sensor.read(t, PointState(x, v, 0.0))
        for t, (x, v) in zip(t_ns.tolist(), truth.values.tolist(), strict=True)
        for sensor in aboard
    ]
    return _sent(readings, lies([sensor.measured for sensor in aboard])), truth


def reference_plant(
    seed: int, duration_ns: int, lies: Lies = honest, *, Q: float = 2.3, R: Sequence[float] = (1.0, 1.0)
) -> Made:
    """One step a second (`linear_plants`). Sensors y1, y2, ... all see C x, with variances R.

    `applied` at t = k carries u(k), which acts from k to k + 1. The start is drawn from N(0, B Q B').
    """
    plant, steps = ReferencePlant(Q=options.number("Q", Q, 0.0)), duration_ns // NANOSECONDS
    t_ns = np.arange(steps + 1, dtype=np.int64) * NANOSECONDS
    states = plant.trajectory(steps, stream(seed, "plant"))
    output = states @ np.array(plant.C)
    forced = plant.input(steps).tolist()
    readings = [Reading(step * NANOSECONDS, "applied", (u,)) for step, u in enumerate(forced)]
    readings.extend(_outputs(seed, t_ns, output, R))
    injection = lies((Measured("applied", 1, sigma=(0.0,)), *_outputs_measured(R)))
    return _sent(readings, injection), Truth(t_ns, ("x1", "x2", "x3"), states)


def constant_velocity(
    seed: int,
    duration_ns: int,
    lies: Lies = honest,
    *,
    q: float = 1.0,
    R: Sequence[float] = (0.01,),
    start_std: Sequence[float] = (1.0, 1.0),
) -> Made:
    """The CV plant at 10 Hz; y1, y2, ... see the position with variances R; x(0) ~ N(0, start_std^2)."""
    period_ns = 100_000_000
    t_ns = stamps(duration_ns, period_ns)
    position_std, velocity_std = options.numbers("start_std", start_std, 2)
    plant = ConstantVelocityPlant(
        options.number("q", q, 0.0), period_ns / NANOSECONDS, (0.0, 0.0), (position_std, velocity_std)
    )
    states = plant.trajectory(t_ns.size - 1, stream(seed, "plant"))
    readings = _sent(_outputs(seed, t_ns, states[:, 0], R), lies(_outputs_measured(R)))
    return readings, Truth(t_ns, ("position", "velocity"), states)


def planar(
    seed: int,
    duration_ns: int,
    lies: Lies = honest,
    *,
    motion: str = "white_acceleration",
    aboard: Sequence[str] = tuple(sensors.PLANAR_SENSORS),
    acceleration_intensity: float = 0.05,
    yaw_acceleration_intensity: float = 0.002,
    truth_period_s: float = 0.01,
) -> Made:
    """The planar vehicle with the sensors in `aboard`; leaving one out changes no other's readings."""
    vehicle = PlanarVehicle(
        options.choice("motion", motion, ("white_acceleration", "smooth")),
        options.number("acceleration_intensity", acceleration_intensity, 0.0),
        options.number("yaw_acceleration_intensity", yaw_acceleration_intensity, 0.0),
    )
    t_ns, states = vehicle.trajectory(duration_ns, stream(seed, "plant"))
    readings: list[Reading] = []
    names = options.words("aboard", aboard, tuple(sensors.PLANAR_SENSORS))
    on_board = [sensors.PLANAR_SENSORS[name](seed) for name in names]
    for sensor in on_board:
        rows = states[:: sensor.period_ns // vehicle.step_ns].tolist()
        readings.extend(sensor.read(n * sensor.period_ns, PlanarState(*row)) for n, row in enumerate(rows))
    step_s = vehicle.step_ns / NANOSECONDS
    every = round(options.number("truth_period_s", truth_period_s, step_s) / step_s)
    yaw, speed = states[:, 2], states[:, 3]
    columns = np.column_stack((states, speed * np.cos(yaw), speed * np.sin(yaw)))
    truth_names = ("x", "y", "yaw", "speed", "yaw_rate", "gyro_bias", "vx", "vy")
    sent = _sent(readings, lies([sensor.measured for sensor in on_board]))
    return sent, Truth(t_ns[::every], truth_names, columns[::every])


def square_robot(seed: int, duration_ns: int, lies: Lies = honest) -> Made:
    """Seed 003: at rest for 5 s, then round a square of 3 m in 16 s."""
    return _square(seed, duration_ns, lies, ("accelerometer", "encoders"))


def square_robot_gyro(seed: int, duration_ns: int, lies: Lies = honest) -> Made:
    """The same robot with a gyro; what the others read is the same."""
    return _square(seed, duration_ns, lies, ("accelerometer", "encoders", "gyro"))


def _square(seed: int, duration_ns: int, lies: Lies, names: Sequence[str]) -> Made:
    readings, truth = run_square(seed, duration_ns)
    std = SquareSensors().std
    aboard = [Measured(name, len(std(name)), sigma=std(name)) for name in names]
    return _sent([reading for reading in readings if reading.sensor in names], lies(aboard)), truth


def ground_vehicle(
    seed: int, duration_ns: int, lies: Lies = honest, *, manoeuvre: str = "dlc", speed_km_h: float = 60.0
) -> Made:
    """Seed 002's car: manoeuvre dlc (double lane change) or jturn, from 20 to 160 km/h, the seed's fastest."""
    speed = options.number("speed_km_h", speed_km_h, 20.0, 160.0)
    asked = Manoeuvre(options.choice("manoeuvre", manoeuvre, ("dlc", "jturn")), speed)
    motion = follow(asked, duration_ns // MILLISECOND_NS)
    return _sent(vehicle_readings(motion, seed), lies(MEASURED)), motion.truth(COLUMNS)


def _outputs(seed: int, t_ns: Times, exact: Floats, variances: Sequence[float]) -> list[Reading]:
    """Sensors y1, y2, ... of one exact signal, each with its own variance and stream."""
    readings: list[Reading] = []
    for index, variance in enumerate(options.numbers("R", variances), start=1):
        noise = np.sqrt(variance) * stream(seed, f"sensor/y{index}").standard_normal(exact.size)
        readings.extend(
            Reading(t, f"y{index}", (z,))
            for t, z in zip(t_ns.tolist(), (exact + noise).tolist(), strict=True)
        )
    return readings


def _outputs_measured(variances: Sequence[float]) -> list[Measured]:
    """What there is to know of those sensors."""
    known = enumerate(options.numbers("R", variances), start=1)
    return [Measured(f"y{index}", 1, sigma=(float(np.sqrt(variance)),)) for index, variance in known]


def _sent(readings: list[Reading], injection: Injection) -> list[Reading]:
    """What the sensors send, in the order in which they measure."""
    return injection.tell(sorted(readings, key=stamp_order)) if injection.faults else readings
