"""A report as a document: one HTML file with everything in it, or a PDF."""

import base64
import io
from collections.abc import Sequence
from datetime import datetime
from html import escape
from pathlib import Path

from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure

from cell.report.drawings import draw
from cell.report.facts import Facts
from drivers.errors import ConfigError

STYLE = """
:root { color-scheme: light dark; font: 16px/1.5 system-ui, sans-serif; }
body { max-width: 72rem; margin: 2rem auto; padding: 0 1rem; }
table { border-collapse: collapse; margin: 1rem 0; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: .3rem 1.2rem .3rem 0; border-bottom: 1px solid #8886; vertical-align: top; }
img { width: 100%; background: #fff; border-radius: .5rem; }
"""

Table = tuple[str, tuple[str, ...], Sequence[tuple[str, ...]]]
"""Title, head and rows of a table."""


def write(facts: Facts, path: Path) -> None:
    """Write a report as its file's ending says.

    Raises:
        ConfigError: The ending is unknown, or the file cannot be written.
    """
    kinds = {".html": _write_html, ".pdf": _write_pdf}
    if path.suffix.lower() not in kinds:
        raise ConfigError(f"--out {path}: *{', *'.join(kinds)} allowed")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        kinds[path.suffix.lower()](facts, path)
    except OSError as error:
        raise ConfigError(f"--out {path}: cannot be written: {error.strerror}") from None


def tables(facts: Facts) -> list[Table]:
    """Return the content of a report in words and figures."""
    low, high = facts.total.interval
    share = "no runs" if facts.total.share is None else f"{100 * facts.total.share:.1f} %"
    times = [
        ("cycle: command to answer", _time(facts.cycle, "median"), _time(facts.cycle, "p95"), _n(facts.cycle)),
        (
            "search + insert + adjust",
            _time(facts.insertion, "median"),
            _time(facts.insertion, "p95"),
            _n(facts.insertion),
        ),
    ]
    for stage in facts.stages:
        name = stage.name.replace("_", " ")
        times.append((name, _time(stage.counted, "median"), _time(stage.counted, "p95"), _n(stage.counted)))
        times.append(("  with its transfer", _time(stage.whole, "median"), _time(stage.whole, "p95"), _n(stage.whole)))
    counts = ", ".join(f"{count} {outcome}" for outcome, count in facts.outcomes.items())
    found: list[Table] = [
        (
            "Yield",
            ("what", "found"),
            [
                ("runs", f"{facts.total.runs} ended: {counts}" if facts.total.runs else "none"),
                ("yield", f"{share}, 95 % interval {100 * low:.1f} to {100 * high:.1f} %"),
                ("first run", local(facts.first)),
                ("last run", local(facts.last)),
                ("largest force", _forces(facts)),
                ("residual of theta", _drift(facts)),
            ],
        ),
        ("Times of successful runs", ("time", "median (s)", "p95 (s)", "n"), times),
    ]
    if facts.losses:
        rows = [(loss.what, str(loss.count), f"{100 * loss.cumulative:.0f} %") for loss in facts.losses]
        found.append(("Why runs did not succeed", ("what", "runs", "together"), rows))
    return found


def local(moment: str) -> str:
    """Return a wall time of the records in local time, with its offset."""
    return datetime.fromisoformat(moment).astimezone().strftime("%Y-%m-%d %H:%M:%S %z") if moment else "-"


def _write_html(facts: Facts, path: Path) -> None:
    picture = io.BytesIO()
    draw(facts).savefig(picture, format="png", dpi=130)
    image = base64.b64encode(picture.getvalue()).decode()
    parts = [_table(table) for table in tables(facts)]
    title = f"Report of the cell, runs since {local(facts.since)}" if facts.since else "Report of the cell, all runs"
    text = (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        f"<style>{STYLE}</style></head>\n<body><h1>{escape(title)}</h1>\n{''.join(parts)}"
        f'<img alt="Yield by day, reasons, times by stage, forces and residual of theta" '
        f'src="data:image/png;base64,{image}"></body></html>\n'
    )
    path.write_text(text, encoding="utf-8")


def _write_pdf(facts: Facts, path: Path) -> None:
    words = Figure(figsize=(11.7, 8.3))
    lines = ["Report of the cell", ""]
    for title, head, rows in tables(facts):
        widths = [max(len(row[column]) for row in (head, *rows)) for column in range(len(head))]
        lines += [
            title,
            *("   ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in (head, *rows)),
            "",
        ]
    words.text(0.05, 0.95, "\n".join(lines), family="monospace", fontsize=9, va="top", parse_math=False)
    with PdfPages(path) as pages:
        pages.savefig(words)
        pages.savefig(draw(facts))


def _table(table: Table) -> str:
    title, head, rows = table
    first = "".join(f'<th scope="col">{escape(name)}</th>' for name in head)
    rest = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>\n" for row in rows)
    return f"<h2>{escape(title)}</h2>\n<table><thead><tr>{first}</tr></thead><tbody>\n{rest}</tbody></table>\n"


def _time(times: dict[str, float] | None, which: str) -> str:
    return "-" if times is None else f"{times[which]:.2f}"


def _n(times: dict[str, float] | None) -> str:
    return "0" if times is None else str(int(times["n"]))


def _forces(facts: Facts) -> str:
    forces = sorted(facts.forces)
    if not forces:
        return "not on record"
    middle, high = forces[len(forces) // 2], forces[min(int(0.95 * len(forces)), len(forces) - 1)]
    return f"median {middle:.1f} N, p95 {high:.1f} N, most {forces[-1]:.1f} N"


def _drift(facts: Facts) -> str:
    drift = facts.drift
    if drift is None:
        return f"{len(facts.residuals)} on record, too few for a trend"
    verdict = "rises: look at the pads" if drift.is_shown else "does not rise beyond chance"
    return f"{verdict}; {drift.per_day:+.4f} a day ({drift.low:+.4f} to {drift.high:+.4f}, n = {drift.n})"
