"""What the study of hole events found: a table of the detectors as they are set, and charts over all thresholds."""

import csv
import math
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.progress import Progress
from rich.table import Table

from cell.config import CellConfig
from cell.journal import versions
from cell.lab.events import (
    DETECTORS,
    HEIGHT,
    WINDOW,
    Highs,
    Listened,
    Watched,
    listen,
    measure,
    rice_chance,
    rice_limit,
)
from cell.statistics import wilson
from cell.workers import on_processes
from skills.catalogue import SEARCH
from skills.spray_search import SpraySearchParams
from skills.tactile.hole_event import limit

TABLE = "events.csv"
RATES = tuple(float(f"{rate:.1g}") for rate in np.geomspace(1e-4, 3.0, 10))
"""Stated false alarms a search over which the charts go."""
DIPS = (5e-5, 1e-4, 1.5e-4, 2e-4, 2.5e-4, 3e-4, 4e-4, 5e-4, 7e-4, 1e-3)
FALLS = (0.08, 0.1, 0.12, 0.14, 0.16, 0.18, 0.2, 0.22, 0.25, 0.3, 0.4)
"""Thresholds by hand over which the charts go: m, and fractions of the average."""
NAMES = {
    HEIGHT: "height of the tip",
    "derivative": "skin: fall, frame to frame",
    "difference": "skin: difference of several frames",
    "cusum": "skin: CUSUM",
}
STYLES = {
    HEIGHT: ("#4477aa", "o"),
    "derivative": ("#ccbb44", "v"),
    "difference": ("#228833", "s"),
    "cusum": ("#aa3377", "D"),
}
INK, GREY = "#222222", "#bbbbbb"


@dataclass(frozen=True, slots=True)
class EventLine:
    """One detector at one threshold; times in s, ways in m, NaN where there is nothing to tell."""

    detector: str
    in_use: bool
    """At the threshold of the config; the others are the charts' curves."""
    stated: float
    """False alarms in a search that the threshold was derived from; NaN where it was set by hand."""
    threshold: float
    """m for the height, fraction for the derivative, else standard deviations."""
    searches: int
    """Without a hole."""
    stopped: int
    """Of them, those with a false event."""
    low: float
    """Wilson 95 % interval of the share of those."""
    high: float
    expected: float
    """That share, from what the threshold was derived from or, for the height, from the spread about the plane."""
    probes: int
    """False events of all searches together, judged at rest; -1 where nobody listened."""
    finds: int
    """Searches in which the judgement took such a place for the hole."""
    finds_high: float
    """Upper end of the Wilson 95 % interval of that share; the lower is 0 where there are none."""
    falls: int
    """Falls of the peg, one in each search with a hole."""
    early: int
    """Of them, those that a false event came before."""
    detected: int
    """Of the others, those with an event within the window."""
    detected_low: float
    detected_high: float
    delay: float
    """Median, from the beginning of the fall to the event."""
    delay_p95: float
    way: float
    """Median of how far the peg's edge has moved by then."""
    way_p95: float


@dataclass(frozen=True, slots=True)
class EventStudy:
    """All that the study found."""

    title: str
    lines: list[EventLine]
    in_hole: int
    """Searches that began with the peg in the hole: no fall."""
    never: int
    """Searches with a hole in which the peg never fell."""
    others: list[str]
    """Endings of searches without a hole other than by their timeout."""
    files: list[Path]


def run(config: CellConfig, seeds: range, with_hole: int, workers: int, folder: Path, progress: Progress) -> EventStudy:
    """Run the study, with a bar, and write its table and its charts into `folder`."""
    bar = progress.add_task("searches", total=len(seeds) + with_hole)
    rows = measure(config, seeds, with_hole, workers, lambda: progress.advance(bar))
    empty, full = [row for row in rows if not row.has_hole], [row for row in rows if row.has_hole]
    fell = [row for row in full if row.after is not None and not row.began_in_hole]
    lines: list[EventLine] = []
    for detector in DETECTORS:
        used, stated = _in_use(config, detector)
        stopped = [row.seed for row in empty if row.before[detector].first(used) is not None]
        heard: list[Listened] = []
        if detector != "derivative":
            heard += on_processes(partial(listen, config, detector), stopped, workers)
        lines.append(_line(config, detector, stated, used, empty, fell, heard, True))
        for rate, value in _curve(config, detector):
            lines.append(_line(config, detector, rate, value, empty, fell, None, False))
    title = (
        f"{len(empty)} searches of {config.params(SEARCH).timeout:g} s without a hole, {len(fell)} falls, simulated, from seed {seeds[0]}; "
        f"python {platform.python_version()}, "
        + ", ".join(f"{name} {versions()[name]}" for name in ("mujoco", "numpy", "code"))
    )
    found = EventStudy(
        title=title,
        lines=lines,
        in_hole=sum(row.began_in_hole for row in full),
        never=sum(row.after is None for row in full),
        others=[f"seed {row.seed}: {row.ended}" for row in empty if row.ended],
        files=[folder / TABLE, folder / "events.png"],
    )
    _write(lines, found.files[0])
    draw(found, empty, config.params(SEARCH), found.files[1])
    return found


def _in_use(config: CellConfig, detector: str) -> tuple[float, float]:
    """Return a detector's threshold by the config, and the rate that it was derived from."""
    search = config.params(SEARCH)
    if detector == HEIGHT:
        return search.dip, math.nan
    if detector == "derivative":
        return search.event.threshold, math.nan
    return _limit(config, detector, search.event.false_alarms), search.event.false_alarms


def _limit(config: CellConfig, method: str, rate: float) -> float:
    params = config.params(SEARCH).event.model_copy(update={"method": method})
    return limit(params, rate / config.skin.rate / config.params(SEARCH).timeout)


def _curve(config: CellConfig, detector: str) -> list[tuple[float, float]]:
    """Return rates and thresholds over which a detector is charted."""
    if detector == HEIGHT:
        return [(math.nan, dip) for dip in DIPS]
    if detector == "derivative":
        return [(math.nan, fall) for fall in FALLS]
    return [(rate, _limit(config, detector, rate)) for rate in RATES]


def _line(
    config: CellConfig,
    detector: str,
    stated: float,
    threshold: float,
    empty: Sequence[Watched],
    fell: Sequence[Watched],
    heard: Sequence[Listened] | None,
    in_use: bool,
) -> EventLine:
    stopped = sum(row.before[detector].first(threshold) is not None for row in empty)
    late = [row for row in fell if row.before[detector].first(threshold) is None]
    events = [event for row in late if (event := _after(row)[detector].first(threshold)) is not None]
    if detector == HEIGHT:
        expected = float(np.mean([rice_chance(row, threshold) for row in empty]))
    elif math.isnan(stated):
        expected = math.nan
    else:
        expected = float(np.mean([-math.expm1(-stated * row.slid / config.params(SEARCH).timeout) for row in empty]))
    finds = sum(one.found for one in heard) if heard is not None else -1
    low, high = wilson(stopped, len(empty))
    seen_low, seen_high = wilson(len(events), len(late))
    times, ways = [event[0] for event in events], [event[2] for event in events]
    is_judged = heard is not None and detector != "derivative"
    return EventLine(
        detector=detector,
        in_use=in_use,
        stated=stated,
        threshold=threshold,
        searches=len(empty),
        stopped=stopped,
        low=low,
        high=high,
        expected=expected,
        probes=sum(one.rests for one in heard) if heard is not None and is_judged else -1,
        finds=finds if is_judged else -1,
        finds_high=wilson(finds, len(empty))[1] if is_judged else math.nan,
        falls=len(fell),
        early=len(fell) - len(late),
        detected=len(events),
        detected_low=seen_low,
        detected_high=seen_high,
        delay=_quantile(times, 0.5),
        delay_p95=_quantile(times, 0.95),
        way=_quantile(ways, 0.5),
        way_p95=_quantile(ways, 0.95),
    )


def _after(row: Watched) -> dict[str, Highs]:
    assert row.after is not None
    return row.after


def _quantile(values: Sequence[float], share: float) -> float:
    return float(np.quantile(values, share)) if values else math.nan


def _write(lines: Sequence[EventLine], path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(EventLine)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(line) for line in lines)


def table(found: EventStudy) -> Table:
    """Return the detectors at the thresholds in use."""
    notes = [
        f"an event within {WINDOW:g} s of the beginning of a fall is its detection; with the hole, {found.in_hole} searches "
        f"began in it and {found.never} never fell",
        *found.others,
    ]
    shown = Table(title=found.title, caption="\n".join(notes))
    for name in (
        "detector",
        "threshold",
        "stopped by a false event",
        "Wilson 95 %",
        "expected",
        "probes",
        "false finds",
        "at most",
        "detected",
        "Wilson 95 %",
        "delay (s)",
        "p95",
        "way (mm)",
        "p95",
    ):
        shown.add_column(name, justify="left" if name == "detector" else "right")
    for line in found.lines:
        if line.in_use:
            is_judged = line.probes >= 0
            late = line.falls - line.early
            shown.add_row(
                NAMES[line.detector],
                _threshold(line),
                f"{line.stopped}/{line.searches}",
                f"{100 * line.low:.2f} to {100 * line.high:.2f} %",
                "by hand" if math.isnan(line.expected) else f"{100 * line.expected:.2g} %",
                str(line.probes) if is_judged else "-",
                str(line.finds) if is_judged else "not judged",
                f"{100 * line.finds_high:.2f} %" if is_judged else "-",
                f"{line.detected}/{late}",
                f"{100 * line.detected_low:.1f} to {100 * line.detected_high:.1f} %",
                f"{line.delay:.2f}",
                f"{line.delay_p95:.2f}",
                f"{1e3 * line.way:.1f}",
                f"{1e3 * line.way_p95:.1f}",
            )
    return shown


def _threshold(line: EventLine) -> str:
    if line.detector == HEIGHT:
        return f"{1e3 * line.threshold:.2f} mm"
    if line.detector == "derivative":
        return f"{100 * line.threshold:.0f} %"
    return f"{line.threshold:.2f} SD"


def draw(found: EventStudy, empty: Sequence[Watched], search: SpraySearchParams, path: Path) -> None:
    """Draw detection and delay against false events, and false events against those stated."""
    figure = Figure(figsize=(14.0, 5.6), layout="constrained")
    seen, late, told = figure.subplots(1, 3)
    handles = []
    for detector, (colour, marker) in STYLES.items():
        lines = sorted(
            (line for line in found.lines if line.detector == detector),
            key=lambda line: (line.stopped, -line.threshold),
        )
        _curves(seen, late, lines, colour, marker)
        handles += seen.plot([], [], marker, color=colour, label=NAMES[detector])
    handles += seen.plot([], [], "o", ms=12, mfc="none", mec=INK, ls="none", label="threshold in use")
    handles += seen.plot(
        [], [], "o", ms=6, mfc="none", mec=INK, ls="none", label="hollow: none seen; bar to upper bound"
    )
    for axes in (seen, late):
        axes.set_xscale("log")
        axes.set_xlabel("searches stopped by a false event, of 1,000\n(Wilson 95 % interval)")
        axes.grid(alpha=0.25)
    seen.set_ylim(-3.0, 103.0)
    seen.set_ylabel("falls detected (%), Wilson 95 % interval")
    seen.set_title("what is seen", fontsize=11)
    late.set_ylim(bottom=0.0)
    late.set_ylabel("from fall to event (s): median, bar to the 95th percentile")
    late.set_title("how soon", fontsize=11)
    _stated(told, found, empty, search)
    figure.legend(handles=handles, loc="outside lower center", ncols=6, fontsize=8.5, frameon=False)
    figure.suptitle(f"Hole events: false alarms against detection and delay\n{found.title}", fontsize=10)
    figure.savefig(path, dpi=150)


def _curves(seen: Axes, late: Axes, lines: Sequence[EventLine], colour: str, marker: str) -> None:
    places = [_place(line) for line in lines]
    shares = [100.0 * line.detected / max(line.falls - line.early, 1) for line in lines]
    kept = [n for n, line in enumerate(lines) if line.falls > line.early]
    seen.plot([places[n] for n in kept], [shares[n] for n in kept], "-", color=colour, lw=1.0, alpha=0.6)
    for n in kept:
        line = lines[n]
        spread: dict[str, Any] = {"xerr": [[places[n] - min(1e3 * line.low, places[n])], [1e3 * line.high - places[n]]]}
        style: dict[str, Any] = {"color": colour, "lw": 0.7, "fmt": "none", "alpha": 0.55}
        bars = [[shares[n] - 100.0 * line.detected_low], [100.0 * line.detected_high - shares[n]]]
        if line.stopped:
            spread["xerr"][0][0] = places[n] - 1e3 * line.low
        seen.errorbar([places[n]], [shares[n]], yerr=np.maximum(bars, 0.0), **spread, **style)
        look: dict[str, Any] = {"ms": 5, "color": colour, "mfc": colour if line.stopped else "white", "ls": "none"}
        seen.plot([places[n]], [shares[n]], marker, **look)
        if math.isfinite(line.delay):
            late.errorbar([places[n]], [line.delay], yerr=[[0.0], [line.delay_p95 - line.delay]], **style)
            late.plot([places[n]], [line.delay], marker, **look)
        if line.in_use:
            seen.plot([places[n]], [shares[n]], "o", ms=12, mfc="none", mec=INK, ls="none", zorder=5)
            late.plot([places[n]], [line.delay], "o", ms=12, mfc="none", mec=INK, ls="none", zorder=5)


def _place(line: EventLine) -> float:
    """Return where a line stands along the false events of 1,000; none seen is drawn at half of one."""
    return 1e3 * max(line.stopped, 0.5) / line.searches


def _stated(axes: Axes, found: EventStudy, empty: Sequence[Watched], search: SpraySearchParams) -> None:
    """Draw how often searches were stopped where the threshold was derived from a stated rate."""
    for detector, (colour, marker) in STYLES.items():
        for rate in RATES:
            if detector == HEIGHT:
                stopped = sum(
                    row.before[HEIGHT].largest > rice_limit(row, rate, search.timeout) for row in empty if row.slid
                )
            else:
                line = next(
                    (x for x in found.lines if x.detector == detector and x.stated == rate and not x.in_use), None
                )
                if line is None:
                    continue
                stopped = line.stopped
            low, high = wilson(stopped, len(empty))
            place = 1e3 * max(stopped, 0.5) / len(empty)
            axes.errorbar(
                [rate],
                [place],
                yerr=[[max(place - 1e3 * low, 0.0) if stopped else 0.0], [1e3 * high - place]],
                fmt=marker,
                ms=5,
                color=colour,
                mfc=colour if stopped else "white",
                lw=0.8,
            )
    shares = [-1e3 * math.expm1(-rate) for rate in RATES]
    axes.plot(RATES, shares, "--", color=GREY, lw=1.2)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("false alarms stated, a search\n(dashes: as stated)")
    axes.set_ylabel("searches stopped by a false event, of 1,000")
    axes.set_title("as stated? (height: from its own spread)", fontsize=11)
    axes.grid(alpha=0.25)
