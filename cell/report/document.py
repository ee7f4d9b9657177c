"""A report as a document: one self-contained HTML file, or a PDF."""

import base64
import io
from collections.abc import Sequence
from html import escape
from pathlib import Path

from matplotlib.figure import Figure

from cell.records.wall_clock import local
from cell.report.drawings import draw
from cell.report.facts import Facts
from cell.report.words import HTML, Table, require_kind, tables
from drivers.errors import ConfigError

ROWS = 24
"""Number of rows of a table on one page of a PDF."""
STYLE = """
:root { color-scheme: light dark; font: 16px/1.5 system-ui, sans-serif; }
body { max-width: 72rem; margin: 2rem auto; padding: 0 1rem; }
table { border-collapse: collapse; display: block; overflow-x: auto; margin: 1rem 0; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: .3rem 1.2rem .3rem 0; border-bottom: 1px solid #8886; vertical-align: top; }
img { width: 100%; background: #fff; border-radius: .5rem; }
"""


def write(facts: Facts, path: Path) -> None:
    """Write a report in the format of the file's suffix.

    Raises:
        ConfigError: The suffix is unknown, or the file cannot be written.
    """
    require_kind(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        (_write_html if path.suffix.lower() == HTML else _write_pdf)(facts, path)
    except OSError as error:
        raise ConfigError(f"--out {path}: cannot be written: {error.strerror}") from None


def _write_html(facts: Facts, path: Path) -> None:
    picture = io.BytesIO()
    draw(facts).savefig(picture, format="png", dpi=130)
    image = base64.b64encode(picture.getvalue()).decode()
    parts = [_table(table) for table in tables(facts)]
    limits = [f"{word} {local(time)}" for word, time in (("since", facts.since), ("until", facts.until)) if time]
    title = f"Report of the cell, {' '.join(['runs', *limits]) if limits else 'all runs'}"
    text = (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1"><title>{escape(title)}</title>'
        f"<style>{STYLE}</style></head>\n<body><h1>{escape(title)}</h1>\n{''.join(parts)}"
        f'<img alt="Yield and times by shift, losses, times by stage, forces and residual of theta" '
        f'src="data:image/png;base64,{image}"></body></html>\n'
    )
    path.write_text(text, encoding="utf-8")


def _write_pdf(facts: Facts, path: Path) -> None:
    from matplotlib.backends.backend_pdf import PdfPages

    with PdfPages(path) as pages:
        for title, head, rows in tables(facts):
            for first in range(0, len(rows), ROWS):
                pages.savefig(_page(title, head, rows[first : first + ROWS]))
        pages.savefig(draw(facts))


def _page(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> Figure:
    figure = Figure(figsize=(11.7, 8.3))
    axes = figure.add_axes((0.05, 0.05, 0.9, 0.85))
    axes.set_axis_off()
    axes.set_title(title, loc="left", weight="bold")
    drawn = axes.table(list(rows), colLabels=list(head), loc="upper left", cellLoc="left", edges="horizontal")
    drawn.auto_set_font_size(False)
    drawn.set_fontsize(9)
    drawn.auto_set_column_width(list(range(len(head))))
    drawn.scale(1.0, 1.3)
    for cell in drawn.get_celld().values():
        cell.get_text().set_parse_math(False)
    return figure


def _table(table: Table) -> str:
    title, head, rows = table
    first = "".join(f'<th scope="col">{escape(name)}</th>' for name in head)
    rest = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>\n" for row in rows)
    return f"<h2>{escape(title)}</h2>\n<table><thead><tr>{first}</tr></thead><tbody>\n{rest}</tbody></table>\n"
