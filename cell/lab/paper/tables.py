"""The tables of the study of the published method."""

from collections.abc import Sequence

from rich.table import Table

from cell.lab.paper.measure import UNKNOWNS, Candidate
from cell.lab.published import PUBLISHED, PUBLISHED_ATTEMPTS, PUBLISHED_SUCCESSES, PUBLISHED_TOTAL
from cell.statistics import wilson


def stages(judged: Sequence[Candidate], title: str) -> Table:
    """Return each judged candidate beside Table I, on seeds that it was not chosen by."""
    table = Table(title=f"The published method under honest errors\n{title}", caption="times are means of successes")
    for name in ("candidate", "stage", "success", "Wilson 95 %", "published", "time (s)", "published", "misfit"):
        table.add_column(name)
    published = [(each.label, f"{each.successes}/{each.attempts}", each.time) for each in PUBLISHED]
    published.append(("total", f"{PUBLISHED_SUCCESSES}/{PUBLISHED_ATTEMPTS}", PUBLISHED_TOTAL))
    for each in judged:
        for number, (line, (label, count, time)) in enumerate(zip(each.stages, published, strict=True)):
            low, high = wilson(line.successes, line.attempts) if line.attempts else (0.0, 1.0)
            table.add_row(
                each.name if number == 0 else "",
                label,
                f"{line.successes}/{line.attempts}",
                f"{100 * low:.1f} to {100 * high:.1f} %",
                count,
                "-" if line.time is None else f"{line.time:.1f}",
                f"{time:.1f}",
                f"{each.misfit:.2f}" if number == 0 else "",
            )
    return table


def spread(fits: Sequence[Candidate]) -> Table:
    """Return the figures that fit: of the best, and the range over all that fit nearly as well."""
    table = Table(title=f"What [gibbons] does not print: {len(fits)} candidates fit")
    for name in ("key", "best", "range of what fits", "searched", "why these bounds"):
        table.add_column(name)
    for unknown in UNKNOWNS:
        values = [each.figures[unknown.key] for each in fits if unknown.key in each.figures]
        best = fits[0].figures.get(unknown.key) if fits else None
        table.add_row(
            unknown.key,
            "the preset's" if best is None else f"{best:g}",
            f"{min(values):g} to {max(values):g}" if values else "-",
            f"{unknown.low:g} to {unknown.high:g}",
            unknown.bounds,
        )
    return table
