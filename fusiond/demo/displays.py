"""Where a demonstration is shown: a live panel, plain lines, or nowhere (`--json`)."""

from __future__ import annotations

from typing import Protocol

from rich.console import Console
from rich.live import Live

from fusiond.demo.scene import Scene
from fusiond.demo.verdict import Verdict
from fusiond.demo.view import LEAST_HEIGHT, LEAST_WIDTH, line, panel, verdict_lines


class Display(Protocol):
    """What a demonstration tells."""

    def say(self, text: str) -> None:
        """What happens before there is a scene."""

    def show(self, scene: Scene) -> None:
        """One moment; called about ten times a second."""

    def close(self) -> None:
        """The last scene stays; allowed more than once."""

    def judge(self, verdict: Verdict) -> None:
        """The end."""


class Panel:
    """Redraws one panel in place."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._live: Live | None = None

    def say(self, text: str) -> None:
        """A dim line."""
        self._console.print(text, style="dim", markup=False, highlight=False)

    def show(self, scene: Scene) -> None:
        """Draw."""
        if self._live is None:
            self._live = Live(console=self._console, auto_refresh=False)
            self._live.start()
        self._live.update(panel(scene, *self._console.size), refresh=True)

    def close(self) -> None:
        """Leave the last panel standing and give the cursor back."""
        if self._live is not None:
            self._live.stop()
            self._live = None

    def judge(self, verdict: Verdict) -> None:
        """Below the panel."""
        self._console.print(verdict_lines(verdict), highlight=False)


class Lines:
    """One plain line for each second of the plant's time."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._second = -1

    def say(self, text: str) -> None:
        """A line."""
        self._print(text)

    def show(self, scene: Scene) -> None:
        """A line where a new second has begun."""
        if scene.estimate is not None and int(scene.t_s) > self._second:
            self._second = int(scene.t_s)
            self._print(line(scene))

    def close(self) -> None:
        """Nothing to do."""

    def judge(self, verdict: Verdict) -> None:
        """A line for each part."""
        for check in verdict.checks:
            mark = {True: "holds", False: "FAILS", None: "not asked"}[check.ok]
            self._print(f"{mark}: {check.name}: {check.text}")
        self._print(f"verdict: {'everything holds' if verdict.ok else 'FAILED'}")

    def _print(self, text: str) -> None:
        # Not through rich, which would break lines at a width that a file does not have.
        print(text, file=self._console.file, flush=True)


class Silence:
    """Shows nothing: the outcome is printed as JSON."""

    def say(self, text: str) -> None:
        """Nothing."""

    def show(self, scene: Scene) -> None:
        """Nothing."""

    def close(self) -> None:
        """Nothing."""

    def judge(self, verdict: Verdict) -> None:
        """Nothing."""


def display_for(console: Console) -> Display:
    """A panel where it can be drawn, otherwise lines."""
    terminal = console.is_terminal and not console.is_dumb_terminal and "utf" in console.encoding.lower()
    room = console.width >= LEAST_WIDTH and console.height >= LEAST_HEIGHT
    return Panel(console) if terminal and room else Lines(console)
