"""Measure the figures of the seeds and write docs/seeds.md with its pictures.

python -m tools.pages.seeds            measure everything, write the page and docs/pictures/seed_*.svg (two minutes)
python -m tools.pages.seeds --check    measure the cheap rows again and compare with the page; exit 1 where one differs
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from tools.pages import seed_000_rows, seed_001, seed_003, seed_004
from tools.pages.seed_row import Row

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = DOCS / "seeds.md"
TEMPLATE = Path(__file__).resolve().parent / "seeds_page.md"
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
SECTIONS: dict[str, Callable[[], list[Row]]] = {
    "000": seed_000_rows.rows,
    "offset": seed_000_rows.offset_rows,
    "001": seed_001.rows,
    "003": seed_003.rows,
    "004": seed_004.rows,
}
"""Rows by the place they take on the page."""
HEADER = "| what | expected | measured | as expected |\n|---|---|---|---|\n"
RELATIVE = 1e-3
"""How far a figure measured on another machine may be from the page's: its last printed digits."""


def page() -> str:
    """The whole page: the template with a table in the place of each {{section}}."""
    text = TEMPLATE.read_text(encoding="utf-8")
    for name, rows in SECTIONS.items():
        table = HEADER + "\n".join(row.written() for row in rows())
        text = text.replace(f"{{{{{name}}}}}", table)
    return text


def same(line: str, other: str) -> bool:
    """Whether two lines say the same: equal but for the last digits of their numbers."""
    if NUMBER.sub("#", line) != NUMBER.sub("#", other):
        return False
    pairs = zip(NUMBER.findall(line), NUMBER.findall(other), strict=True)
    return all(
        abs(float(a) - float(b)) <= RELATIVE * max(abs(float(a)), abs(float(b)), 1e-2) for a, b in pairs
    )


def differences(committed: str, rows: Sequence[Row]) -> list[str]:
    """What the rows say now where the page says something else."""
    lines = {line.split("|")[1].strip(): line for line in committed.splitlines() if line.startswith("| ")}
    found = []
    for row in rows:
        now = row.written()
        if row.what not in lines or not same(lines[row.what], now):
            found.append(f"page: {lines.get(row.what, '(no such row)')}\nnow:  {now}")
    return found


def cheap_rows() -> list[Row]:
    """The rows that `--check` measures again."""
    return [row for rows in SECTIONS.values() for row in rows() if row.cheap]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool; returns the exit code."""
    command = argparse.ArgumentParser(prog="python -m tools.pages.seeds", description="Write docs/seeds.md.")
    command.add_argument(
        "--check", action="store_true", help="compare the page with the cheap rows measured now"
    )
    if command.parse_args(argv).check:
        found = differences(PAGE.read_text(encoding="utf-8"), cheap_rows())
        print("\n".join(found) or f"{PAGE.name}: {len(cheap_rows())} rows measured again, all the same")
        return 1 if found else 0
    from tools.pages.seed_pictures import draw  # matplotlib, which --check does without

    PAGE.write_text(page(), encoding="utf-8")
    draw(DOCS / "pictures")
    return 0


if __name__ == "__main__":
    sys.exit(main())
