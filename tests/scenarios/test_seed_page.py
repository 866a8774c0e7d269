"""docs/seeds.md says what the engine does."""

from __future__ import annotations

from tools.pages import seeds


def test_the_page_is_what_is_measured_now():
    """The cheap rows, measured again, are those of the page."""
    assert seeds.differences(seeds.PAGE.read_text(encoding="utf-8"), seeds.cheap_rows()) == []


def test_a_changed_figure_is_seen():
    row = next(row for row in seeds.cheap_rows() if row.what == "gain K")
    wrong = row.written().replace("0.48051 | yes", "0.48251 | yes")
    committed = seeds.PAGE.read_text(encoding="utf-8").replace(row.written(), wrong)
    assert len(seeds.differences(committed, [row])) == 1
    assert seeds.differences(seeds.PAGE.read_text(encoding="utf-8"), [row]) == []


def test_every_figure_of_the_page_is_as_expected():
    assert "**no**" not in seeds.PAGE.read_text(encoding="utf-8")


def test_every_picture_of_the_page_is_there():
    text = seeds.PAGE.read_text(encoding="utf-8")
    named = [part.split(")")[0] for part in text.split("](")[1:] if part.startswith("pictures/")]
    assert named
    assert [name for name in named if not (seeds.DOCS / name).is_file()] == []
