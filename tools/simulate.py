"""Write a simulated log and its truth as CSV.

    python -m tools.simulate minicar --seed 0 --for 30 --out log.csv --truth truth.csv
    python -m tools.simulate planar --set motion=smooth --set 'aboard=["gps","gyro"]' --jitter gps=0.1 --out
    log.csv
    python -m tools.simulate minicar --inject ultrasonic.bias=0.5@10+5 --out log.csv

Exit 0 done, 1 a file cannot be written, 2 the operator's mistake.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from fusiond.errors import ConfigError
from fusiond.simulation.logs import write_log, write_truth
from fusiond.simulation.registry import SYSTEMS, simulate


def parser() -> argparse.ArgumentParser:
    """The command line."""
    options = "; ".join(f"{name}: {', '.join(system.options) or 'none'}" for name, system in SYSTEMS.items())
    command = argparse.ArgumentParser(
        prog="python -m tools.simulate",
        description="Write a simulated log as CSV.",
        epilog=f"Options for --set: {options}.",
    )
    command.add_argument("name", metavar="NAME", help=f"one of {', '.join(SYSTEMS)}")
    command.add_argument("--seed", type=int, default=0)
    command.add_argument(
        "--for", dest="duration_s", type=float, metavar="S", help="seconds; default the system's own"
    )
    command.add_argument("--out", type=Path, required=True, metavar="LOG.csv")
    command.add_argument("--truth", type=Path, metavar="TRUTH.csv")
    command.add_argument(
        "--delay",
        action="append",
        default=[],
        metavar="SENSOR=S",
        help="how much later than stamped its readings arrive",
    )
    command.add_argument(
        "--jitter",
        action="append",
        default=[],
        metavar="SENSOR=S",
        help="a random delay on top, between 0 and S",
    )
    command.add_argument(
        "--set",
        dest="options",
        action="append",
        default=[],
        metavar="OPTION=VALUE",
        help="an option of the system; the value is JSON or plain text",
    )
    command.add_argument(
        "--inject",
        action="append",
        default=[],
        metavar="SPEC",
        help="a fault: SENSOR[.CHANNEL].KIND[=SIZE]@START[+DURATION]",
    )
    command.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    return command


def pairs(texts: Sequence[str], flag: str) -> dict[str, object]:
    """["a=1", "b=x"] -> {"a": 1, "b": "x"}; raises ConfigError where there is no "="."""
    split = [text.partition("=") for text in texts]
    for name, equals, _ in split:
        if not (name and equals):
            raise ConfigError(f"{flag} {name}: no value; write NAME=VALUE")
    return {name: value_of(text) for name, _, text in split}


def options_of(texts: Sequence[str]) -> dict[str, object]:
    """The system's own options; raises ConfigError for what has a flag of its own."""
    options = pairs(texts, "--set")
    for name in sorted(options.keys() & {"name", "seed", "duration_s", "delay_s", "jitter_s", "inject"}):
        raise ConfigError(
            f"--set {name}: not an option of a system; use NAME, --seed, --for, --delay, --jitter or --inject"
        )
    return options


def value_of(text: str) -> object:
    """The JSON value of a text, or the text itself."""
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return text


def seconds(texts: Sequence[str], flag: str) -> dict[str, float]:
    """["gps=0.1"] -> {"gps": 0.1}; raises ConfigError where a value is no number."""
    late: dict[str, float] = {}
    for name, value in pairs(texts, flag).items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ConfigError(f"{flag} {name}={value}: not a number; give seconds")
        late[name] = float(value)
    return late


def write(arguments: argparse.Namespace) -> dict[str, object]:
    """Simulate, write, and say what was written."""
    run = simulate(
        arguments.name,
        arguments.seed,
        arguments.duration_s,
        delay_s=seconds(arguments.delay, "--delay"),
        jitter_s=seconds(arguments.jitter, "--jitter"),
        inject=arguments.inject,
        **options_of(arguments.options),
    )
    write_log(arguments.out, run)
    if arguments.truth:
        write_truth(arguments.truth, run.truth)
    counts = Counter(reading.sensor for reading in run.readings)
    return {
        "name": run.name,
        "seed": run.seed,
        "readings": len(run.readings),
        "sensors": dict(sorted(counts.items())),
        "log": str(arguments.out),
        "truth": str(arguments.truth) if arguments.truth else None,
    }


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool; returns the exit code."""
    arguments = parser().parse_args(argv)
    try:
        written = write(arguments)
    except ConfigError as mistake:
        print(mistake, file=sys.stderr)
        return 2
    except OSError as failure:
        print(failure, file=sys.stderr)
        return 1
    print(
        json.dumps(written)
        if arguments.json
        else f"{written['name']}: {written['readings']} readings ({written['sensors']}) in {written['log']}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
