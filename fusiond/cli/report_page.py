"""The page of a report: one HTML file with its pictures and tables inside; it loads nothing."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from html import escape

from fusiond import __version__
from fusiond.cli.report_lanes import numbered, plain, shown_sensors
from fusiond.cli.report_pictures import Pictures
from fusiond.cli.report_svg import DARK, LIGHT
from fusiond.recording.fault_words import SIZELESS, FaultObject
from fusiond.recording.report_run import RunReport
from fusiond.types import seconds

STYLE = """
:root { color-scheme: light dark; --ground: #ffffff; --soft: #f3f5f7; --rule: #d5dae0; %(light)s }
@media (prefers-color-scheme: dark) { :root { --ground: #14181d; --soft: #1e242b; --rule: #39424c; %(dark)s } }
@media print {
  :root { color-scheme: light; --ground: #ffffff; --soft: #f3f5f7; --rule: #d5dae0; %(light)s }
  details > :not(summary) { break-inside: avoid }
  main { max-width: none; padding: 0 }
  svg { min-width: 0 !important }
}
* { box-sizing: border-box }
body { margin: 0; background: var(--ground); color: var(--ink); font: 15px/1.5 system-ui, sans-serif }
main { max-width: 1080px; margin: 0 auto; padding: 1.5rem }
h1 { font-size: 1.6rem; margin: 0 }
h2 { font-size: 1.15rem; margin: 2.2rem 0 .4rem }
h3 { font-size: 1rem; margin: 1.2rem 0 .2rem }
p { margin: .3rem 0; max-width: 75ch }
figure { margin: .4rem 0 0; break-inside: avoid; overflow-x: auto }
svg { width: 100%%; min-width: 720px; height: auto; display: block }
dl { display: flex; flex-wrap: wrap; gap: .6rem; margin: 1rem 0 }
dl div { background: var(--soft); border-radius: .5rem; padding: .5rem .9rem }
dt { font-size: .8rem; opacity: .75 }
dd { margin: 0; font-size: 1.15rem; font-variant-numeric: tabular-nums }
.scroll { overflow-x: auto }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; break-inside: avoid }
th, td { text-align: left; padding: .25rem .9rem .25rem 0; border-bottom: 1px solid var(--rule); white-space: nowrap }
td.number, th.number { text-align: right }
pre { background: var(--soft); padding: 1rem; overflow-x: auto; font-size: .8rem; white-space: pre-wrap }
.words { background: var(--soft); border-left: .3rem solid var(--faulty); padding: .5rem .9rem; margin: .5rem 0 }
"""
PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>%(title)s</title>
<style>%(style)s</style>
</head>
<body>
<main>
%(body)s
</main>
</body>
</html>
"""
NUMERIC = frozenset("0123456789-+")
OPEN = "open"
"""Stands for the end of what has none yet."""
UNIX_S = 1e9
"""Times from here on are taken for seconds since 1970."""


def page(run: RunReport) -> str:
    """The whole page; the same text for the same run.

    Args:
        run: with at least one reading.
    """
    pictures = Pictures(run)
    body = [
        f"<h1>{escape(run.layout.name)}</h1>",
        f"<p>{escape(run.path.name)}</p>",
        facts(run),
        *(f'<p class="words">{escape(note)}</p>' for note in run.notes),
        *faults(run, pictures),
        *states(run, pictures),
        *sensors(run, pictures),
        *tables(run),
    ]
    title = escape(f"{run.layout.name}: {run.path.name}")
    return PAGE % {"title": title, "style": style(), "body": "\n".join(body)}


def style() -> str:
    """The style sheet: a picture's colours are variables in it."""
    light, dark = (
        " ".join(f"--{role}: {colour};" for role, colour in colours.items()) for colours in (LIGHT, DARK)
    )
    return STYLE % {"light": light, "dark": dark}


def facts(run: RunReport) -> str:
    """What one wants to know first."""
    found = numbered(run)
    open_ones = sum(fault["cleared_s"] is None for _, fault in found)
    told = {
        "readings": f"{run.counts['readings']:,}",
        "duration": f"{run.duration_s:.3f} s",
        "from": moment(run.origin_ns),
        "service at the end": run.health.service.label.replace("_", " "),
        "faults found": f"{len(found)}" + (f", {open_ones} open" if open_ones else ""),
    }
    if run.alarms():
        told["model blamed"] = f"{len(run.alarms())} times"
    items = (f"<div><dt>{escape(k)}</dt><dd>{escape(v)}</dd></div>" for k, v in told.items())
    return f"<dl>{''.join(items)}</dl>"


def moment(t_ns: int) -> str:
    """A time of the log; with its date where it is Unix time."""
    t_s = seconds(t_ns)
    date = f"{datetime.fromtimestamp(t_s, UTC):, %Y-%m-%d %H:%M:%S} UTC" if t_s >= UNIX_S else ""
    return f"{t_s:.3f} s{date}"


def faults(run: RunReport, pictures: Pictures) -> Iterable[str]:
    """The time line and the table of faults."""
    yield "<h2>Faults</h2>"
    after = "" if pictures.shift_s == seconds(run.origin_ns) else ", seconds after the first reading"
    yield (
        "<p>A triangle stands at the onset of a fault, a stroke where it was found; numbers are those of the table. "
        "The service is nominal, degraded, dead reckoning or invalid, in the colours of healthy, suspect, faulty and "
        f"excluded. Times are those of the axis{after}.</p>"
    )
    yield f"<figure>{pictures.time_line()}</figure>"
    found = numbered(run)
    if not found:
        yield "<p>No fault was found.</p>"
    else:
        head = (
            "",
            "sensor",
            "kind",
            "channel",
            "onset (s)",
            "detected (s)",
            "cleared (s)",
            "size",
            "ambiguous with",
        )
        rows = [
            (str(k + 1), name, *fault_row(pictures, name, fault)) for k, (name, fault) in enumerate(found)
        ]
        yield table(head, rows)
    for alarm in run.alarms():
        over = "still" if alarm["cleared_s"] is None else f"until {pictures.at(alarm['cleared_s']):.3f} s"
        found_s = pictures.at(alarm["detected_s"])
        yield f'<p class="words">The model was blamed from {found_s:.3f} s, {over}.</p>'


def fault_row(pictures: Pictures, name: str, fault: FaultObject) -> tuple[str, ...]:
    """A fault's cells after its number and its sensor."""
    run, at = pictures.run, pictures.at
    slots = run.layout.sensors[run.layout.numbers[name]].channels
    channel = "all" if fault["channel"] is None else slots[fault["channel"]].name
    size = "" if fault["kind"] in SIZELESS else plain(fault).split(" ", 1)[1].split(" since ")[0]
    return (
        fault["kind"], channel, f"{at(fault['onset_s']):.3f}", f"{at(fault['detected_s']):.3f}",
        OPEN if fault["cleared_s"] is None else f"{at(fault['cleared_s']):.3f}",
        size.split(" on channel")[0], ", ".join(fault["ambiguous_with"]),
    )  # fmt: skip


def states(run: RunReport, pictures: Pictures) -> Iterable[str]:
    """States, and commands where there are any."""
    yield "<h2>States</h2>"
    yield "<p>Each with its band of three standard deviations; faults are shaded from onset to end.</p>"
    yield f"<figure>{pictures.states()}</figure>"
    if run.layout.controls and len(run.commands.values.filled()):
        yield f"<h2>Commands</h2><figure>{pictures.commands()}</figure>"


def sensors(run: RunReport, pictures: Pictures) -> Iterable[str]:
    """Every sensor that corrects the state, then those that drive it."""
    if run.sensors:
        yield (
            "<h2>Sensors</h2><p>The innovation is a reading minus its prediction. Triangles are readings that were "
            "weighed and not used; far ones stand at the edge. Faults of the sensor are shaded.</p>"
        )
    for trace in run.sensors:
        yield f"<h3>{escape(trace.sensor.name)}</h3>"
        if trace.channels:
            yield f"<figure>{pictures.sensor(trace, f'sensor{trace.sensor.number}')}</figure>"
        else:
            yield "<p>None of its readings was weighed.</p>"
    if run.inputs:
        yield "<h2>Inputs</h2><p>Their readings drive the prediction, nothing compares them with anything.</p>"
    for drive in run.inputs:
        yield f"<h3>{escape(drive.sensor.name)}</h3>"
        if len(drive.z.filled()):
            yield f"<figure>{pictures.input(drive, f'input{drive.sensor.number}')}</figure>"
        else:
            yield "<p>None of its readings was used.</p>"


def tables(run: RunReport) -> Iterable[str]:
    """Readings by verdict, counters, configuration."""
    summaries = run.summaries()
    shown = [run.layout.sensors[number].name for number in shown_sensors(run)]
    verdicts = list(dict.fromkeys(["used", *(v for name in shown for v in summaries[name].verdicts)]))
    head = ("sensor", *(v.replace("_", " ") for v in verdicts), "mean NIS", "health at the end")
    rows = []
    for name in shown:
        of = summaries[name]
        nis = "" if of.nis_mean is None else f"{of.nis_mean:.4f}"
        rows.append((name, *(f"{of.verdicts.get(v, 0):,}" for v in verdicts), nis, of.health))
    yield "<h2>Readings</h2>" + table(head, rows)
    kept = {**{k: f"{v:,}" for k, v in run.counts.items()}, **run.recorded}
    yield "<h2>Counters</h2>" + table(("what", "number"), [(k.replace("_", " "), v) for k, v in kept.items()])
    if run.config_text:
        yield f"<h2>Configuration</h2><details><summary>show</summary><pre>{escape(run.config_text)}</pre></details>"
    yield f"<p>fusiond {escape(__version__)}</p>"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of text; what looks like a number stands to the right."""
    columns = [
        all(row[k][:1] in NUMERIC or row[k] == OPEN for row in rows if row[k]) for k in range(len(head))
    ]
    marks = [' class="number"' if right and k else "" for k, right in enumerate(columns)]

    def line(cells: Sequence[str], tag: str) -> str:
        inner = "".join(
            f"<{tag}{mark}>{escape(cell)}</{tag}>" for cell, mark in zip(cells, marks, strict=True)
        )
        return f"<tr>{inner}</tr>"

    body = "".join(line(row, "td") for row in rows)
    return f'<div class="scroll"><table><thead>{line(head, "th")}</thead><tbody>{body}</tbody></table></div>'
