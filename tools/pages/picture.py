"""Draw the terminal of a demonstration as SVG, for the README.

    python -m tools.pages.picture docs/pictures/demo.svg [--name minicar] [--for 30] [--at 12] [--seed 0]

The panel is that of the time `--at`, the verdict that of the end. Exit 0 done, 1 the demonstration failed, 2 the
operator's mistake.
"""

from __future__ import annotations

import argparse
import copy
import io
import re
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.terminal_theme import DIMMED_MONOKAI

from fusiond.demo.perform import perform
from fusiond.demo.scene import Scene
from fusiond.demo.verdict import Verdict
from fusiond.demo.view import WIDTH, panel, verdict_lines
from fusiond.errors import ConfigError, FusiondError

FONTS = "ui-monospace, Menlo, Consolas, DejaVu Sans Mono, monospace"
FONT_FACES = re.compile(r"@font-face \{.*?\}\s*", re.DOTALL)


class Camera:
    """Keeps the first scene at or after a time.

    Args:
        at_s: of the plant's time.
    """

    def __init__(self, at_s: float) -> None:
        self._at_s = at_s
        self.scene: Scene | None = None

    def say(self, text: str) -> None:
        """Not in the picture."""

    def show(self, scene: Scene) -> None:
        """Press the button when it is time."""
        if self.scene is None and scene.t_s >= self._at_s:
            self.scene = copy.deepcopy(scene)

    def close(self) -> None:
        """Nothing to do."""

    def judge(self, verdict: Verdict) -> None:
        """Not asked: the outcome has it."""


def drawing(scene: Scene, verdict: Verdict) -> str:
    """The terminal as SVG, with the reader's own fonts: a picture should fetch nothing."""
    console = Console(
        record=True,
        width=WIDTH,
        file=io.StringIO(),
        force_terminal=True,
        color_system="truecolor",
        legacy_windows=False,
    )
    console.print("$ make demo", style="dim", highlight=False)
    console.print(panel(scene))
    console.print(verdict_lines(verdict), highlight=False)
    svg = console.export_svg(title="fusiond demo", theme=DIMMED_MONOKAI, unique_id="demo")
    return FONT_FACES.sub("", svg).replace("Fira Code, monospace", FONTS)


def parser() -> argparse.ArgumentParser:
    """The command line."""
    command = argparse.ArgumentParser(
        prog="python -m tools.pages.picture", description="A demonstration as SVG."
    )
    command.add_argument("out", type=Path, metavar="OUT.svg")
    command.add_argument("--name", default="minicar")
    command.add_argument("--for", dest="duration_s", type=float, default=30.0, metavar="S")
    command.add_argument(
        "--at", dest="at_s", type=float, default=12.0, metavar="S", help="when the panel is drawn"
    )
    command.add_argument("--seed", type=int, default=0)
    return command


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a demonstration and write its picture."""
    given = parser().parse_args(arguments)
    camera = Camera(given.at_s)
    try:
        outcome = perform(given.name, given.duration_s, given.seed, camera)
    except ConfigError as error:
        print(error, file=sys.stderr)
        return 2
    except FusiondError as error:
        print(error, file=sys.stderr)
        return 1
    if camera.scene is None:
        print(f"picture: nothing was seen at {given.at_s:g} s; choose an earlier --at", file=sys.stderr)
        return 2
    given.out.parent.mkdir(parents=True, exist_ok=True)
    given.out.write_text(drawing(camera.scene, outcome.verdict), encoding="utf-8")
    print(given.out)
    return 0 if outcome.verdict.ok else 1


if __name__ == "__main__":
    sys.exit(main())
