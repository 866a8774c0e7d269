"""Every command. Heavy rooms are imported by the command that needs them, so that `--help` is instant."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import orjson
import typer

from fusiond import __version__
from fusiond.errors import LogError

SPEC = (
    "SPEC is SENSOR[.CHANNEL].KIND[=SIZE]@START[+DURATION]: times in s from the first reading on, channels from 0, "
    "KIND one of delay, scale, bias, drift, noise, spike, stuck, nan, intermittent, broken."
)
app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Fault-tolerant sensor fusion: one trustworthy state from sensors that may lie.",
)
config_app = typer.Typer(no_args_is_help=True, help="Configurations.")
app.add_typer(config_app, name="config")

ConfigPath = Annotated[Path, typer.Argument(metavar="CONFIG", help="TOML configuration.", show_default=False)]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
Connect = Annotated[
    list[str] | None, typer.Option("--connect", help="Endpoint to connect to, tcp/127.0.0.1:7447.")
]
Listen = Annotated[
    list[str] | None, typer.Option("--listen", help="Endpoint to listen on; port 0 picks one.")
]
Seed = Annotated[int, typer.Option(help="Of everything random.", min=0)]
Inject = Annotated[
    list[str] | None,
    typer.Option(
        "--inject",
        metavar="SPEC",
        help="A fault, e.g. gps.bias=5@10+3; see below. May be repeated.",
    ),
]
Part = Annotated[
    str | None, typer.Option("--as", help="Run one machine's part: a node of service.nodes, or center.")
]
RunPath = Annotated[Path, typer.Argument(help="MCAP recording with reports.", show_default=False)]
Endpoint = Annotated[str, typer.Option("--connect", help="Endpoint of the daemon.")]


def _emit(result: dict[str, Any]) -> None:
    """One JSON object on stdout; a number that is not finite becomes null."""
    typer.echo(orjson.dumps(result, default=str))


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"fusiond {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print it.")
    ] = False,
) -> None:
    """Options before the command."""


@app.command(epilog=SPEC)
def demo(
    name: Annotated[
        str, typer.Argument(help="A simulated system; a name that is none lists them all.")
    ] = "minicar",
    for_s: Annotated[float, typer.Option("--for", help="Seconds.", min=1.0)] = 30.0,
    inject: Inject = None,
    as_json: Json = False,
    seed: Seed = 0,
) -> None:
    """Start a simulated plant, its sensors and the real daemon on loopback; watch them; end with a verdict."""
    from fusiond.demo import run_demo

    raise typer.Exit(run_demo(name, for_s, as_json, seed, inject or ()))


@app.command()
def run(
    config: ConfigPath,
    connect: Connect = None,
    listen: Listen = None,
    record: Annotated[Path | None, typer.Option(help="Record everything that is decided.")] = None,
    part: Part = None,
    rank: Annotated[
        int | None,
        typer.Option(min=0, help="Which of the daemons that stand in for each other; 0 speaks first."),
    ] = None,
) -> None:
    """Run the daemon until SIGTERM; prints `ready ENDPOINT...` when it takes readings."""
    from fusiond.cli.configuring import load
    from fusiond.service.serve import serve

    assembly = load(config, part)
    raise typer.Exit(
        serve(
            assembly,
            listen=listen or (),
            connect=connect or (),
            record=record,
            on_ready=lambda endpoints: print("ready", *endpoints, flush=True),
            config_text=config.read_text(encoding="utf-8"),
            rank=rank,
        )
    )


@app.command()
def check(
    config: ConfigPath,
    plots: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Draw the fuzzy sets and the surface of adaptation there."),
    ] = None,
    as_json: Json = False,
    part: Part = None,
) -> None:
    """Validate a configuration and print what is derived from it."""
    from fusiond.assembly.summary import summary
    from fusiond.cli.configuring import load
    from fusiond.cli.diagnosability_view import show_diagnosability
    from fusiond.cli.loop_view import show_loop
    from fusiond.cli.views import console, show_adaptation, show_check

    assembly = load(config, part)
    result = summary(assembly)
    if plots is not None:
        from fusiond.cli.check_plots import write_plots

        result["plots"] = [str(path) for path in write_plots(assembly, plots)]
    if as_json:
        _emit(result)
    else:
        show_check(result)
        show_adaptation(result["adaptation"])
        for path in result.get("plots", ()):
            console.print(f"drawn: {path}")
        show_diagnosability(result, console)
        show_loop(result, console)


@app.command(epilog=SPEC)
def replay(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="CSV or MCAP.", show_default=False)],
    config: ConfigPath,
    truth: Annotated[Path | None, typer.Option(help="CSV to compare with: t_s and names of states.")] = None,
    out: Annotated[Path | None, typer.Option(help="Write the run here, MCAP.")] = None,
    smooth: Annotated[
        bool, typer.Option("--smooth", help="Also what the whole recording says of every moment.")
    ] = False,
    inject: Inject = None,
    seed: Seed = 0,
    as_json: Json = False,
    part: Part = None,
) -> None:
    """Run a recording through the same engine, as fast as it goes, bit for bit repeatable."""
    from fusiond.cli.configuring import load
    from fusiond.cli.replaying import replay_log
    from fusiond.cli.views import show_replay

    result = replay_log(
        load(config, part),
        log,
        truth=truth,
        out=out,
        config_text=config.read_text(encoding="utf-8"),
        smooth=smooth,
        inject=inject or (),
        seed=seed,
    )
    if as_json:
        _emit(result)
    else:
        show_replay(result)
    if not any(sensor["used"] for sensor in result["sensors"].values()):
        fact = "no reading was used" if result["refused"] else "holds no reading"
        raise LogError(f"{log}: {fact}; is it whole, and {config} its configuration?")


@app.command()
def record(
    config: ConfigPath,
    out: Annotated[Path, typer.Argument(help="MCAP to write.", show_default=False)],
    connect: Connect = None,
    listen: Listen = None,
    for_s: Annotated[
        float | None, typer.Option("--for", help="Seconds; until SIGTERM without it.", min=0.1)
    ] = None,
    part: Part = None,
) -> None:
    """Listen to a configuration's sensors and record them, without a daemon."""
    from fusiond.cli.configuring import load
    from fusiond.service.record import listen_and_record

    raise typer.Exit(
        listen_and_record(
            load(config, part),
            out,
            listen=listen or (),
            connect=connect or (),
            for_s=for_s,
            on_ready=lambda endpoints: print("ready", *endpoints, flush=True),
            config_text=config.read_text(encoding="utf-8"),
        )
    )


@app.command("import")
def import_(
    src: Annotated[
        Path, typer.Argument(help="rosbag 1 or 2, MCAP, CSV, MAT, or a folder.", show_default=False)
    ],
    mapping: Annotated[Path, typer.Argument(metavar="MAP", help="TOML: which column is which sensor.")],
    out: Annotated[Path, typer.Argument(help="MCAP or CSV to write.", show_default=False)],
    json_readings: Annotated[bool, typer.Option(help="Also as JSON, for viewers that plot.")] = False,
    as_json: Json = False,
) -> None:
    """Import a foreign recording."""
    from dataclasses import asdict

    from fusiond.cli.configuring import naming
    from fusiond.cli.views import counting, show_import
    from fusiond.recording.importing import import_recording

    with naming(mapping), counting(f"import {src.name}") as progress:
        imported = import_recording(src, mapping, out, json_readings=json_readings, progress=progress)
    if as_json:
        _emit(asdict(imported))
    else:
        show_import(imported, out)


@app.command()
def report(
    run: RunPath,
    out: Annotated[Path, typer.Option("--out", "-o", help="HTML file to write.", show_default=False)],
    truth: Annotated[Path | None, typer.Option(help="CSV to compare with: t_s and names of states.")] = None,
) -> None:
    """Pictures and tables of a run, as one HTML file that needs nothing else."""
    from fusiond.cli.reporting import write_report

    size = write_report(run, out, truth)
    typer.echo(f"{out}: {size / 1e3:,.0f} kB")


@app.command()
def diff(run_a: RunPath, run_b: RunPath, as_json: Json = False) -> None:
    """Where two runs differ first, and by how much. Exit status 1 where they differ."""
    from fusiond.cli.views import show_diff
    from fusiond.recording.diff import diff as compare

    difference = compare(run_a, run_b)
    if as_json:
        _emit(difference.json_object())
    else:
        show_diff(difference)
    raise typer.Exit(0 if difference.equal else 1)


@app.command()
def status(
    name: Annotated[
        str | None, typer.Argument(help="Name of the configuration; any daemon without it.")
    ] = None,
    connect: Endpoint = "tcp/127.0.0.1:7447",
    as_json: Json = False,
) -> None:
    """Ask a running daemon how it is."""
    from fusiond.cli.status_view import show_status
    from fusiond.service.ask import ask

    answer = ask(name, "status", connect)
    if as_json:
        _emit(answer)
    else:
        show_status(answer)


@app.command()
def why(
    sensor: Annotated[str, typer.Argument(help="Of the running configuration.", show_default=False)],
    name: Annotated[str | None, typer.Argument(help="Name of the configuration.")] = None,
    at: Annotated[
        float | None, typer.Option("--at", help="Around this time, s; the last ones without it.")
    ] = None,
    last: Annotated[int, typer.Option("--last", help="Readings to tell of.", min=1, max=500)] = 12,
    connect: Endpoint = "tcp/127.0.0.1:7447",
    as_json: Json = False,
) -> None:
    """Ask a running daemon why it did with a sensor's readings what it did."""
    from fusiond.cli.explaining import show_why
    from fusiond.service.ask import ask

    fields = {"sensor": sensor, "last": last, **({} if at is None else {"at": at})}
    answer = ask(name, "why", connect, fields=fields)
    if as_json:
        _emit(answer)
    else:
        show_why(answer)


@app.command()
def watch(
    name: Annotated[
        str | None, typer.Argument(help="Name of the configuration; any daemon without it.")
    ] = None,
    connect: Endpoint = "tcp/127.0.0.1:7447",
    for_s: Annotated[
        float | None, typer.Option("--for", help="Seconds; until Ctrl-C without it.", min=0.1)
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON objects, one a line.")] = False,
) -> None:
    """Follow a running daemon live: estimate, health, faults and events."""
    from fusiond.cli.watching import watch as follow

    follow(name, connect, for_s=for_s, as_json=as_json)


@config_app.command()
def schema() -> None:
    """Print the JSON Schema of a configuration."""
    from fusiond.config import schema as json_schema

    typer.echo(json.dumps(json_schema(), indent=2))


@config_app.command()
def kinds(
    kind: Annotated[str | None, typer.Argument(help="One of them, with all it takes.")] = None,
) -> None:
    """List the built-in models, sensors and control laws, or what one of them takes."""
    from fusiond.cli.kinds_view import show_kinds

    show_kinds(kind)
