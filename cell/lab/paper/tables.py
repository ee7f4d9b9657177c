"""Tables of the study of the published method."""

from collections.abc import Sequence

from rich.table import Table

from cell.lab.paper.measure import Candidate, fitting
from cell.lab.paper.unknowns import UNKNOWNS
from cell.lab.published import PUBLISHED, PUBLISHED_ATTEMPTS, PUBLISHED_SUCCESSES, PUBLISHED_TOTAL
from cell.records.statistics import wilson


def stages(judged: Candidate, title: str) -> Table:
    """Return the kept figures beside Table I, on seeds that the fit did not use."""
    table = Table(
        title=f"The published method under honest errors\n{title}",
        caption=f"times are means of successes; misfit {judged.misfit:.2f}{'; ' if judged.error else ''}{judged.error}",
    )
    for name in ("stage", "success", "Wilson 95 %", "published", "Wilson 95 %", "time (s)", "published", "ratio"):
        table.add_column(name)
    published = [(each.label, each.successes, each.attempts, each.time) for each in PUBLISHED]
    published.append(("total", PUBLISHED_SUCCESSES, PUBLISHED_ATTEMPTS, PUBLISHED_TOTAL))
    for line, (label, successes, attempts, time) in zip(judged.stages, published, strict=True):
        table.add_row(
            label,
            f"{line.successes}/{line.attempts}",
            _interval(line.successes, line.attempts),
            f"{successes}/{attempts}",
            _interval(successes, attempts),
            "-" if line.time is None else f"{line.time:.1f}",
            f"{time:.1f}",
            "-" if line.time is None else f"{line.time / time:.2f}",
        )
    return table


def spread(found: Sequence[Candidate]) -> Table:
    """Return the fitted figures: of the best candidate of each stage, and the range over those that fit nearly as well."""
    table = Table(title="What [gibbons] does not print")
    for name in ("key", "kept", "range of what fits", "searched", "why these bounds"):
        table.add_column(name)
    for unknown in UNKNOWNS:
        values = [each.figures[unknown.key] for each in fitting(found, unknown.stage)]
        table.add_row(
            unknown.key,
            f"{values[0]:g}" if values else "-",
            f"{min(values):g} to {max(values):g}, {len(values)} candidates" if values else "-",
            f"{unknown.low:g} to {unknown.high:g}",
            unknown.bounds,
        )
    return table


def _interval(successes: int, attempts: int) -> str:
    low, high = wilson(successes, attempts)
    return f"{100 * low:.1f} to {100 * high:.1f} %"
