"""A table of a benchmark."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

Progress = Callable[[str], None]
"""Is told what is being measured."""


@dataclass(frozen=True)
class Table:
    """For the terminal, for JSON and for a page."""

    name: str
    """By which a page says where it goes."""
    title: str
    columns: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]

    def markdown(self) -> str:
        """As a table of Markdown, without its title."""
        lines = ["| " + " | ".join(self.columns) + " |", "|" + "---|" * len(self.columns)]
        lines += ["| " + " | ".join(row) + " |" for row in self.rows]
        return "\n".join(lines) + "\n"


def put_into_page(page: Path, tables: Sequence[Table], taken_on: str, *, machine: str = "machine") -> None:
    """Replace each table between its `<!-- benchmark NAME -->` and the next `<!-- end -->` of a Markdown page, and what
    they were taken on between `<!-- benchmark machine -->` (or another name for it) and its end. What the page has no
    place for is left out.

    Raises:
        ValueError: the page cannot be read, or has no place for any of them.
    """
    text = page.read_text(encoding="utf-8") if page.is_file() else ""
    blocks = {table.name: table.markdown() for table in tables} | {machine: f"{taken_on}\n"}
    found = 0
    for name, block in blocks.items():
        begin, end = f"<!-- benchmark {name} -->", "<!-- end -->"
        before, opened, rest = text.partition(begin)
        _, closed, after = rest.partition(end)
        if opened and closed:
            text, found = f"{before}{begin}\n\n{block}\n{end}{after}", found + 1
    if not found:
        raise ValueError(f"--page {page} must be a file with lines <!-- benchmark NAME --> and <!-- end -->.")
    page.write_text(text, encoding="utf-8")
