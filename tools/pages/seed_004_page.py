"""Measure seed 004's filters and fusion modes and write docs/seed_004.md with its pictures.

python -m tools.pages.seed_004_page            measure everything, write the page and docs/pictures (10 minutes)
python -m tools.pages.seed_004_page --check    measure the cheap rows again; exit 1 where the page differs
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from tools.pages import seed_004_faults
from tools.pages.seed_004_rows import SECTIONS
from tools.pages.seed_row import Row
from tools.pages.seeds import DOCS, HEADER, differences

PAGE = DOCS / "seed_004.md"
TEMPLATE = Path(__file__).with_suffix(".md")


def page() -> str:
    """The whole page: the template with a table in the place of each {{section}}."""
    text = TEMPLATE.read_text(encoding="utf-8")
    for name, rows in SECTIONS.items():
        table = HEADER + "\n".join(row.written() for row in rows())
        text = text.replace(f"{{{{{name}}}}}", table)
    return text.replace("{{faults}}", seed_004_faults.table())


def cheap_rows() -> list[Row]:
    """The rows that `--check` measures again: well under a second each, and no compiler."""
    return [row for rows in SECTIONS.values() for row in rows() if row.cheap]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool; returns the exit code."""
    command = argparse.ArgumentParser(
        prog="python -m tools.pages.seed_004_page", description="Write docs/seed_004.md."
    )
    command.add_argument(
        "--check", action="store_true", help="compare the page with the cheap rows measured now"
    )
    if command.parse_args(argv).check:
        found = differences(PAGE.read_text(encoding="utf-8"), cheap_rows())
        print("\n".join(found) or f"{PAGE.name}: {len(cheap_rows())} rows measured again, all the same")
        return 1 if found else 0
    from tools.pages.seed_004_pictures import draw  # matplotlib, which --check does without

    PAGE.write_text(page(), encoding="utf-8")
    draw(DOCS / "pictures")
    return 0


if __name__ == "__main__":
    sys.exit(main())
