"""Chart of the study of the published method: speed against accuracy, stage by stage."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from cell.lab.paper.measure import Candidate, fitting
from cell.lab.published import PUBLISHED, PUBLISHED_ATTEMPTS, PUBLISHED_SUCCESSES, PUBLISHED_TOTAL
from cell.records.statistics import wilson

CHART = "paper.png"
AIM = 1.2
"""Target factor on a published time, in either direction."""
FITTED, LEFT, JUDGED, REAL = "#555555", "#cccccc", "#cc2222", "#4477aa"


def draw(found: Sequence[Candidate], judged: Candidate, title: str, folder: Path) -> Path:
    """Draw success against mean time for each stage and for the whole; return the file.

    Points: every candidate on the first half of the seeds, the judged figures, and Table I with the targets.
    """
    figure = Figure(figsize=(11.0, 8.0), layout="constrained")
    panels = figure.subplots(2, 2).ravel()
    published = [(each.name, each.label, each.successes, each.attempts, each.time) for each in PUBLISHED]
    published.append(("", "the whole insertion", PUBLISHED_SUCCESSES, PUBLISHED_ATTEMPTS, PUBLISHED_TOTAL))
    for number, (axes, (name, label, successes, attempts, time)) in enumerate(zip(panels, published, strict=True)):
        low, high = wilson(successes, attempts)
        axes.fill_between([time / AIM, time * AIM], 100 * low, 100 * high, color=REAL, alpha=0.15, lw=0)
        fits = {each.name for each in fitting(found, name)}
        for each in (each for each in found if each.half == name):
            line = each.stages[number] if each.stages else None
            if line is not None and line.attempts and line.time is not None:
                colour = FITTED if each.name in fits else LEFT
                size = 3.0 + 0.35 * line.attempts
                share = 100 * line.successes / line.attempts
                axes.plot([line.time], [share], "o", color=colour, markersize=size, markeredgecolor="white")
        line = judged.stages[number] if judged.stages else None
        side = 1
        if line is not None and line.attempts and line.time is not None:
            side = -1 if line.time < time else 1
            _point(axes, line.time, line.successes, line.attempts, JUDGED, "D", side)
        _point(axes, time, successes, attempts, REAL, "s", -side)
        axes.set_title(label, fontsize=10)
        axes.set_ylim(-3.0, 103.0)
        axes.set_xlim(0.0, 1.12 * axes.get_xlim()[1])
        axes.grid(alpha=0.3)
        axes.set_xlabel("mean time of the stage's successes (s)")
        axes.set_ylabel("success (%)")
    _legend(figure, len(judged.rows))
    figure.suptitle(f"The published method under honest errors\n{title}", fontsize=9)
    path = folder / CHART
    figure.savefig(path, dpi=110)
    return path


def _legend(figure, count: int) -> None:  # type: ignore[no-untyped-def]
    """Explain the marks below the panels."""
    axes = figure.axes[0]
    marks = [
        ("s", REAL, 6, "[gibbons], Table I, 40 trials in life; shaded: its interval, and 20 % of its time"),
        ("D", JUDGED, 6, f"judged, {count} seeds that nothing was chosen by; bars: Wilson 95 %"),
        ("o", FITTED, 8, "candidates that fit best on the first half; the larger, the more trials"),
        ("o", LEFT, 6, "candidates that were left"),
    ]
    handles = [
        axes.plot([], [], mark, color=colour, markersize=size, label=label)[0] for mark, colour, size, label in marks
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=2, fontsize=8)


def _point(axes, time: float, successes: int, attempts: int, colour: str, mark: str, side: int) -> None:  # type: ignore[no-untyped-def]
    """Draw one rate with its interval, and its figures below, to the left or right by the sign of `side`."""
    rate, (low, high) = successes / attempts, wilson(successes, attempts)
    bounds = [[max(100 * (rate - low), 0.0)], [max(100 * (high - rate), 0.0)]]
    axes.errorbar([time], [100 * rate], yerr=bounds, fmt=mark, color=colour, markersize=6, capsize=3, zorder=3)
    told = f"{successes}/{attempts}\n{time:.1f} s"
    axes.annotate(
        told,
        (time, 100 * low),
        (6 * side, -2),
        textcoords="offset points",
        ha="left" if side > 0 else "right",
        va="top",
        color=colour,
        fontsize=8,
    )
