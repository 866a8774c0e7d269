"""Pictures of docs/scoreboard.md, as SVG with the same bytes for the same figures. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter

from tools.pages.figures import figure

Curves = Mapping[str, Mapping[str, Sequence[Any]]]
OURS, BOUND, OTHER = "#00798c", "#222222", "#edae49"


def _against(place: Axes, curve: Mapping[str, Sequence[Any]], at: str, bound: str) -> None:
    place.loglog(curve[at], curve["bound"], color=BOUND, lw=1.2, label=bound)
    place.loglog(curve[at], curve["delay"], "o-", color=OURS, ms=4, lw=1.2, label="fusiond")
    place.legend(loc="upper right")


def _ticks(place: Axes, at: Sequence[float]) -> None:
    place.xaxis.set_minor_formatter(NullFormatter())
    place.set_xticks(at, [f"{one:g}" for one in at])


def delay(path: Path, curves: Curves) -> None:
    """Delay against size with the bound drawn in, delay against drift, probability of finding."""
    with figure(path, 10.0, 3.2) as drawn:
        places = drawn.subplots(1, 3)
        if "white.sharp" in curves:
            _against(places[0], curves["white.sharp"], "d", "exact CUSUM, white")
        if "reference" in curves:
            plant, name = curves["reference"], "reference plant"
            places[0].loglog(plant["d"], plant["bound"], ":", color=BOUND, lw=1.2, label=f"oracle, {name}")
            places[0].loglog(plant["d"], plant["delay"], "s:", color=OTHER, ms=4, label=f"fusiond, {name}")
            places[0].legend(loc="lower left", fontsize=7.0)
        _ticks(places[0], (0.5, 1.0, 2.0, 4.0))
        places[0].set(title="bias", xlabel="steady whitened shift", ylabel="mean delay, readings")
        if "drift" in curves:
            _against(places[1], curves["drift"], "slope", "oracle CUSUM")
        places[1].set(
            title="drift, reference plant", xlabel="slope, sigma a reading", ylabel="mean delay, readings"
        )
        if "finite" in curves:
            finite = curves["finite"]
            places[2].plot(finite["size"], finite["oracle"], color=BOUND, lw=1.2, label="oracle CUSUM")
            places[2].plot(finite["size"], finite["found"], "o-", color=OURS, ms=4, lw=1.2, label="fusiond")
            places[2].legend(loc="upper left")
        places[2].set(
            title="constant velocity, one sensor", xlabel="bias, sigma", ylabel="found within 50 readings"
        )


def promise(path: Path, curves: Curves) -> None:
    """Measured over promised interval with its confidence: noise as declared, and not."""
    with figure(path, 10.0, 3.6) as drawn:
        left, right = drawn.subplots(1, 2)
        if "promise" in curves:
            told = curves["promise"]
            names = [
                f"{name}\n{promised:,.0f}"
                for name, promised in zip(told["name"], told["promised"], strict=True)
            ]
            ratios = [np.array(told[one]) / np.array(told["promised"]) for one in ("value", "low", "high")]
            _bars(left, names, ratios, OURS)
            left.axvspan(0.8, 1.5, color=OURS, alpha=0.12, lw=0)
        left.set(title="noise as declared, promised samples", xlabel="measured / promised")
        if "wrong" in curves:
            wrong = curves["wrong"]
            for profile, color, shift in (("sharp", OURS, -0.15), ("robust", OTHER, 0.15)):
                kept = [k for k, one in enumerate(wrong["profile"]) if one == profile]
                chosen = [np.array([wrong[one][k] for k in kept]) for one in ("value", "low", "high")]
                _bars(right, [wrong["name"][k] for k in kept], chosen, color, shift, profile)
            right.axvline(1.0 / 3.0, color=BOUND, lw=0.8, ls="--")
            drawn.legend(loc="outside lower right", ncols=2)
            right.set(xscale="log")
            _ticks(right, (0.1, 0.2, 0.5, 1.0, 2.0))
        right.set_title("noise wrong, promised 10 000 samples", loc="right")
        right.set_xlabel("measured / promised")


def _bars(
    place: Axes, names: Sequence[str], bands: Sequence[Any], color: str, shift: float = 0.0, label: str = ""
) -> None:
    at = np.arange(len(names))
    value, low, high = bands
    errors = np.array([value - low, high - value])
    place.errorbar(value, at + shift, xerr=errors, fmt="o", color=color, ms=4, capsize=2, label=label or None)
    place.set_yticks(at, names)
    place.axvline(1.0, color=BOUND, lw=0.6)


def confusion(path: Path, curves: Curves) -> None:
    """Who erred against who was named, measured beside predicted, as shares of each row."""
    found = {name.split(".", 1)[1]: one for name, one in curves.items() if name.startswith("confusion.")}
    with figure(path, 10.0, 4.6) as drawn:
        places = drawn.subplots(2, max(len(found), 1), squeeze=False)
        for column, (name, one) in enumerate(found.items()):
            counts = np.array(one["counts"], dtype=float)
            measured = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0)
            sensors = len(counts)
            predicted = np.zeros_like(measured)
            predicted[
                np.arange(sensors), [sensors] * sensors if one["ambiguous"][0] else np.arange(sensors)
            ] = 1.0
            _matrix(places[0][column], predicted, f"{name}\npredicted")
            _matrix(places[1][column], measured, "measured")


def _matrix(place: Axes, shares: Any, title: str) -> None:
    sensors = len(shares)
    place.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    for (row, column), share in np.ndenumerate(shares):
        place.text(
            column, row, f"{share:.0%}", ha="center", va="center", color="white" if share > 0.6 else BOUND
        )
    names = [f"y{k + 1}" for k in range(sensors)]
    place.set_xticks(range(sensors + 2), [*names, "set", "none"])
    place.set_yticks(range(sensors), names)
    place.set(title=title, xlabel="named", ylabel="at fault")
    place.grid(visible=False)


def draw(folder: Path, curves: Curves) -> None:
    """All pictures."""
    folder.mkdir(parents=True, exist_ok=True)
    delay(folder / "scoreboard_delay.svg", curves)
    promise(folder / "scoreboard_promise.svg", curves)
    confusion(folder / "scoreboard_confusion.svg", curves)
