"""The sections of a configuration and their keys, each with its default and what it means."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Range = Annotated[list[float], Field(min_length=2, max_length=2)]
Numbers = dict[str, Finite]


class Section(BaseModel):
    """Base of every section: no unknown keys, no silent conversions, no changes after loading."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, use_attribute_docstrings=True)


class ModelSection(Section):
    """The process model. Its parameters stand beside `kind`."""


class SensorSection(Section):
    """One sensor. The parameters of its kind stand beside these."""

    key: str | None = None
    """Zenoh key expression it publishes on. By default NAMESPACE/sensor/NAME; `reference` and `applied` stand directly
    under NAMESPACE."""
    rate_hz: Positive | None = None
    """Its nominal rate; silence is judged by it."""
    noise_std: dict[str, NotNegative] = {}
    """Standard deviation of each channel, by its name with unit: { range_m = 0.3 }."""
    noise_covariance: list[list[float]] | None = None
    """Full covariance of the measured channels instead of noise_std."""
    valid: dict[str, Range] = {}
    """Lowest and highest plausible value of a channel; what lies outside is refused as out_of_range."""
    max_silence_s: Positive | None = None
    """Longest healthy silence; by default three periods of rate_hz but at least 0.1 s; without a rate no limit."""
    delay_s: NotNegative = 0.0
    """How much later its stamps are than what it measured."""
    tolerance: dict[str, NotNegative] = {}
    """Lasting error of a channel that is no fault, by its name with unit: what the data sheet calls accuracy."""
    group: str | None = None
    """Sensors of one group may share one fault: one scale on all ranges, one delay of all that comes by radio."""
    policy: Literal["auto", "exclude", "compensate"] = "auto"
    """What is done with it when it is faulty: not used (exclude), or used with its error taken off (compensate);
    auto: excluded where the other sensors still see every state, else compensated. Who errs on though an error is taken
    off is excluded where that can be done."""
    repeats: Literal["fresh", "held"] = "fresh"
    """Whether an equal value at a new time is fresh evidence, or a driver that repeats its last fix."""
    adapt_noise: bool = True
    """Whether its noise is estimated where [adaptation] is asked for; else it is as declared."""
    resolution: dict[str, NotNegative] = {}
    """Smallest step of a channel's numbers, by its name with unit: its noise is not believed to be less."""


class FaultsSection(Section):
    """Finding out which sensor lies, how, by how much and since when."""

    mean_time_between_false_alarms_s: Positive = 36_000.0
    """One promise for the whole service: every test's threshold is derived from it."""
    profile: Literal["sharp", "robust"] = "sharp"
    """sharp: noise is as declared, faults are found as early as can be. robust: it may be wrong by a third."""
    window: Annotated[int, Field(ge=16)] = 128
    """Readings of evidence kept for telling which sensor it is, at least; more where the slowest sensor needs them."""
    protect: list[str] = []
    """States whose estimate carries a protection level: its error is no larger, whichever one correcting sensor is
    wrong and whether or not anybody noticed. Inputs are trusted, and so is `initial` for what one sensor alone sees."""
    protect_outside: Annotated[float, Field(gt=0, lt=1, allow_inf_nan=False)] = 1e-5
    """Promised largest probability that an error exceeds its level."""


Trapezoid = Annotated[list[float], Field(min_length=4, max_length=4)]
Rule = Annotated[list[str], Field(min_length=3, max_length=3)]


class FuzzySection(Section):
    """The fuzzy sets and rules of adaptation. A set is a trapezoid: where it begins, is full, is full no more, ends."""

    scatter: dict[str, Trapezoid] = {
        "far_less": [-3.0, -3.0, -1.5, -0.6],
        "less": [-1.5, -0.6, -0.6, 0.0],
        "as_expected": [-0.6, 0.0, 0.0, 0.6],
        "more": [0.0, 0.6, 0.6, 1.5],
        "far_more": [0.6, 1.5, 3.0, 3.0],
    }
    """Sets of ln(mean square of the innovations / what is expected of it), limited to -3 and 3."""
    mean: dict[str, Trapezoid] = {
        "low": [0.0, 0.0, 2.5, 3.5],
        "high": [2.5, 3.5, 5.0, 5.0],
    }
    """Sets of |mean of the innovations| in its own standard deviations, limited to 5."""
    change: dict[str, Trapezoid] = {
        "fall_fast": [-1.5, -1.0, -1.0, -0.5],
        "fall": [-0.9, -0.4, -0.4, 0.1],
        "hold": [-0.5, 0.0, 0.0, 0.5],
        "rise": [-0.05, 0.45, 0.45, 0.95],
        "rise_fast": [0.5, 1.0, 1.0, 1.5],
    }
    """Sets of the change of ln R in one reading, in units of `step`."""
    rules: list[Rule] = [
        ["far_less", "any", "fall_fast"],
        ["less", "any", "fall"],
        ["as_expected", "any", "hold"],
        ["more", "low", "rise"],
        ["far_more", "low", "rise_fast"],
        ["any", "high", "hold"],
    ]
    """[scatter, mean, change]; "any" leaves an input out. A mean is a bias, which is no noise: it holds R."""
    step: Positive = 0.35
    """Largest change of ln R in one reading."""


class AdaptationSection(Section):
    """Estimating the noise that readings have, which is seldom what is declared."""

    method: Literal["interacting", "variational", "fuzzy", "fuzzy_additive"] = "interacting"
    """interacting: noise is one of a ladder of levels and jumps now and then. variational: it wanders slowly. fuzzy:
    rules on how innovations scatter. fuzzy_additive: the published design that the rules descend from, to compare."""
    floor: Annotated[float, Field(gt=0, le=1)] = 0.01
    """Smallest variance believed, as a share of the declared one. Never below what `resolution` alone makes."""
    ceiling: Annotated[float, Field(ge=1, allow_inf_nan=False)] = 1e4
    """Largest variance believed, as a multiple of the declared one."""
    readings_between_jumps: Annotated[float, Field(gt=1)] = 250.0
    """How many readings noise stays what it is, on average (interacting); inf: for good."""
    separate_filters: bool = True
    """Keep a filter for every few levels where there is one scalar sensor and a small state; else one for all."""
    window: Annotated[float, Field(gt=1, allow_inf_nan=False)] = 20.0
    """Readings that an estimate rests on (fuzzy, variational)."""
    slow_window: Annotated[float, Field(ge=20, allow_inf_nan=False)] = 200.0
    """Readings that the slow R, by which faults are found, rests on."""
    largest_change: Annotated[float, Field(gt=1, allow_inf_nan=False)] = 10.0
    """Factor by which R may change from one reading to the next."""
    fuzzy: FuzzySection = FuzzySection()


class InputSection(SensorSection):
    """A sensor that drives the prediction instead of correcting it."""

    kind: Literal["input"]
    """Makes it an input."""
    drives: list[str]
    """Inputs of the process model that its numbers set, in order."""
    without_input_std: dict[str, NotNegative] = {}
    """Standard deviation of each input, by its name with unit, about 0 while the sensor is silent or excluded."""
    hold: Literal["next", "previous"] = "next"
    """Whether a reading holds until the next one, or describes the interval that ends at its stamp."""


class InitialSection(Section):
    """The state before the first reading, by state name with unit."""

    state: Numbers = {}
    """Its mean; what is not named starts at 0."""
    std: dict[str, NotNegative] = {}
    """Its standard deviation, of every state: 0 where it is known."""
    covariance: list[list[float]] | None = None
    """Its full covariance instead of std, states in the model's order; it may be singular."""


class FilterSection(Section):
    """How the state is estimated."""

    recursion: Literal["ud", "conventional", "information", "seed"] = "ud"
    """ud: factors U, d, compiled, positive semi-definite by construction. The others are seed 004's, in plain numpy:
    conventional: its Model 1, P = (I - M C) P; information: its Model 2 without P^-1; seed: Model 2 as printed."""
    guard: Literal["seed", "shift", "eigen_floor", "restore"] | None = None
    """How a covariance found unsound is repaired; by default `seed` with the recursion seed, else eigen_floor."""
    seed_diagonal: Literal["variance", "deviation", "identity_variance", "identity_deviation"] = "variance"
    """Reading of the seed's repair |o_ii|: N(0, 1e-14) with that variance or that deviation, or N(0, 1e-4) likewise."""
    random_seed: Annotated[int, Field(ge=0)] = 0
    """Seed of the random diagonals that the seed's repair adds."""
    leave_one_out: bool = True
    """Keep, beside the filter of all sensors, one filter for each that leaves it out."""
    local_filters: bool = True
    """Keep one filter for each sensor that can bear one, hearing it alone."""
    accept_unobservable: list[str] = []
    """States that may stay unobservable: dead reckoning knows its position only from where it started."""
    covariance_hz: Positive | None = None
    """The mean goes with every input, the covariance at least this often and before every correction: cheaper with a
    fast IMU, the same to rounding. By default with every input too."""
    guard_unobservable: list[str] | None = None
    """Errors, by name, that are not learned while they cannot be observed: their estimate is held, their variance may
    grow. By default what the model says (strapdown: the heading and the gyro's biases); [] for none."""


class FusionSection(Section):
    """How several sensors become one state."""

    topology: Literal[
        "centralized", "stacked", "information", "seed_averaged",
        "federated", "federated_reset", "information_sum", "covariance_intersection",
    ] = "centralized"  # fmt: skip
    """centralized: one reading after the other, compiled with recursion ud. The rest are plain numpy, without the
    leave-one-out bank. Readings of one stamp together: stacked, information, seed_averaged (seed 004's mean gain,
    which misreports its covariance). A local filter for each sensor: federated (never reset, never optimistic),
    federated_reset and information_sum (both exact), covariance_intersection (estimates of unknown provenance)."""


class HistorySection(Section):
    """How late a reading may be, and what a clock may do."""

    horizon_s: NotNegative = 1.0
    """A reading this much older than the newest is still put in its place, exactly; an older one is too_late."""
    max_ahead_s: Positive = 10.0
    """A reading stamped this much ahead of the clock is refused as from_future."""
    resync_count: Annotated[int, Field(ge=2)] = 20
    """Refused readings in a row that agree with each other prove that the time base itself has jumped."""


class HealthSection(Section):
    """When the estimate is no longer worth its name."""

    dead_reckoning_s: Positive = 1.0
    """Dead reckoning once nothing has corrected the state for this long."""
    invalid_s: Positive = 5.0
    """Invalid once nothing has corrected the state for this long."""


class StandInSection(Section):
    """The command in the place of an input that is silent or excluded: what a push does is known without a sensor."""

    sensor: Name
    """The input, one with `without_input_std`, which then says how well the plant is known."""
    rate_of: Name
    """State of the plant (`states` of the law) whose rate of change the input measures."""
    plus: Name | None = None
    """State that the input's readings have on top: its bias."""


class ControlSection(Section):
    """The control law. Its parameters stand beside these."""

    rate_hz: Positive
    """Commands per second of data time."""
    reference: Numbers = {}
    """Goal until one comes on `reference`, by name with unit."""
    lowest: Numbers = {}
    """Smallest command, by name with unit; the estimate is told what was really done."""
    highest: Numbers = {}
    """Largest command, by name with unit."""
    slew: dict[str, Positive] = {}
    """Fastest change of the command, by name with unit and `_s` (per second): { force_n_s = 20.0 }."""
    fade_s: NotNegative = 0.0
    """The bump of the command when a sensor comes or goes, or the state is reset, is faded out over this time."""
    waits_for: list[str] = []
    """Sensors whose reading of the same moment a due command waits for, unless they missed the last."""
    wait_s: NotNegative | None = None
    """Longest such wait; by default half a period."""
    dead_reckoning_s: NotNegative | None = None
    """Longest time that commands come from dead reckoning; by default until the estimate is invalid."""
    doubt_s: NotNegative | None = None
    """Longest time that commands come from an estimate that no sound sensor corrects, only suspect or faulty ones
    (where noise is estimated, one that is but noisier than declared is sound); by default no limit."""
    largest_std: dict[str, Positive] = {}
    """Deviations of the estimate, by name with unit, above which nothing is commanded but the safe command."""
    safe: Literal["hold", "zero", "ramp"] = "hold"
    """What is commanded, not valid, while there is no estimate to command from: the last command (hold), `safe_command`
    (zero), or a straight line from one to the other (ramp)."""
    safe_command: Numbers = {}
    """The command at rest, by name with unit; what is not named is 0."""
    safe_ramp_s: Positive = 1.0
    """How long the ramp takes."""
    stand_in: StandInSection | None = None
    """What the command stands in for, with a section [faults]; by default nothing."""
    deadline_s: Positive | None = None
    """Time without a command after which the service publishes the safe one; by default five periods of commands, or
    of `service.tick_hz`, and no less than 0.25 s."""
    cost_time_s: Positive = 60.0
    """The running cost is a mean that forgets with this time constant."""


class ServiceSection(Section):
    """How the daemon meets the network. Loopback only, and no multicast, unless told otherwise."""

    mode: Literal["peer", "client", "router"] = "peer"
    """Its part in the Zenoh network; a client needs something to connect to."""
    role: Literal["alone", "node", "center"] = "alone"
    """alone: hears every sensor itself. node: filters the sensors of one of `nodes` beside them and sends on what it
    learns. center: hears the sensors of all `nodes` through them, the others itself. `fusiond run --as` says it too."""
    nodes: dict[Name, list[Name]] = {}
    """Machines that filter sensors beside them: for each its updating sensors. One file serves all of them."""
    node: Name | None = None
    """Which of `nodes` this is, with role = "node"."""
    group: list[str] = []
    """Endpoints of daemons that stand in for each other, in the order of their ranks: each listens on its own and
    connects to those before it. One of them speaks, the others stand by in step; one file serves all of them."""
    rank: Annotated[int, Field(ge=0)] | None = None
    """Which of them this is, from 0; `fusiond run --rank` says it too. Without `group`: `listen` and `connect` hold."""
    takeover_s: Positive = 1.0
    """How long the daemon that speaks may give no sign of life until another takes over; a crash is seen at once."""
    listen: list[str] = ["tcp/127.0.0.1:7447"]
    """Endpoints where sensors and asking commands connect; port 0 picks a free one."""
    connect: list[str] = []
    """Endpoints of routers or peers to connect to."""
    multicast: bool = False
    """Look for peers, and be found, by multicast."""
    publish_hz: Positive = 50.0
    """Highest rate of `estimate`."""
    format: Literal["json", "record"] = "json"
    """Encoding of estimate and control; everything else that goes out is JSON."""
    ring: Annotated[int, Field(ge=16)] = 8192
    """Puts that each subscription, and the queue behind them, holds while the loop is busy; the oldest go first."""
    tick_hz: Positive = 20.0
    """How often time passes where no reading says so."""


class RecordingSection(Section):
    """What the daemon writes with --record, beside every reading and report."""

    estimate_hz: NotNegative = 50.0
    """Rate of the JSON estimates that plotting tools read; 0 for none."""
