"""False and true hole events: how often a search stops on a plate without a hole, and how soon it detects a drop.

A search slides over the plate without a stop, while its detector runs. Up to its first event, a
search that obeys the detector follows the same path. Seeds with a dip on a plate without a hole run again with stops,
to measure the result of the judgement at rest.
"""

import argparse
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from cell.commands.arguments import out_folder
from cell.config.cell_config import CellConfig
from cell.devices.assembly import Cell, assemble, opened
from cell.lab.arguments import load_simulated, seeds_of
from cell.lab.report import StudyReport, reported
from cell.lab.rows import known, quantile
from cell.lab.tables import Columns, share, table
from cell.lab.workers import each_of
from drivers.errors import CellError
from drivers.frames import end_point
from drivers.quantities import ImpedanceSetpoint, Vector
from skills.catalogue import GRASP, SEARCH
from skills.contract import Observation, Outcome, Request, SkillContext
from skills.flow import run_stage
from skills.search import spray_search
from skills.search.feel import EdgeEvidence
from skills.search.spray_search import SpraySearchResult

WINDOW = 1.0
"""Time after the start of a drop in which an event is its detection, s."""


@dataclass(frozen=True, slots=True)
class HoleEventRow:
    """One search without a stop; times in s, NaN if there is no value."""

    seed: int
    has_hole: bool
    slid: float
    """Time of sliding, s; with a hole, until the drop."""
    falsely: float
    """Time of sliding at the first event over solid plate."""
    fell: bool
    """True if the peg dropped into the hole while it slid."""
    delay: float
    """Time from the start of the drop to its event."""
    rests: int = 0
    """Number of stops of a search on the same plate that obeys its detector; 0 if it had nothing to obey."""
    found: bool = False
    """True if that search reported a hole where there is none."""

    @property
    def is_fall(self) -> bool:
        """True if the peg dropped without an earlier false event."""
        return self.fell and math.isnan(self.falsely)


class _Watch:
    """Records the detector's events of a search, and the drop in the truth."""

    def __init__(self, cell: Cell, has_hole: bool) -> None:
        self.seen: Observation | None = None
        self.is_done, self.has_fallen, self.began_in_hole = False, False, False
        self.slid = 0.0
        self.falsely = self.delay = math.nan
        self._cell, self._has_hole = cell, has_hole
        self._start: float | None = None
        self._over: float | None = None
        self._deepest = 0.0

    def record(self, seen: Observation, setpoint: ImpedanceSetpoint | None) -> None:
        self.seen = seen

    def poll(self) -> Request:
        return Request.STOP if self.is_done else Request.RUN

    def slide(self) -> None:
        """Record the start of sliding."""
        if self._start is None:
            assert self.seen is not None
            self._start = self.seen.stamp

    def note(self, is_edge: bool) -> None:
        """Record whether there is evidence of an edge in this scan; the first call of a scan."""
        assert self.seen is not None
        if self._start is None:
            return
        now = self.seen.stamp
        if self._has_hole:
            self._compare(self._start)
        if self._over is None:
            self.slid = now - self._start
            if is_edge and math.isnan(self.falsely):
                self.falsely = self.slid
        elif is_edge and math.isnan(self.delay):
            self.delay = now - self._over

    def _compare(self, start: float) -> None:
        """Check in the truth for a drop."""
        assert self.seen is not None
        truth, now = self._cell.truth(), self.seen.stamp  # type: ignore[misc]
        _, axis = end_point(self.seen.arm.tcp, truth.theta, self._cell.config.peg.length)
        edge = self._cell.config.peg.part.lowest(np.array(truth.tip), axis, self.seen.arm.tcp.rotation[:, 2])
        depth = truth.depth + truth.tip[2] - edge[2]
        # Depth of the peg's lowest point below the plate from which it is over the hole, m; the plate's contacts
        # yield by a hundredth of it.
        if self._over is None and depth > 5e-5:
            # Time since the start of sliding below which the peg came down in the hole, so that there is no drop, s.
            self.began_in_hole = now - start < 0.05
            self._over, self._deepest, self.delay = now, 0.0, math.nan
        if self._over is None:
            return
        self._deepest = max(self._deepest, depth)
        if now - self._over >= WINDOW:
            # Smallest depth of a drop, m; shallower passes over the hole's edge are ignored.
            self.is_done = self.has_fallen = self._deepest >= 2e-4
            self._over = None


class _Unheeded(EdgeEvidence):
    """Evidence that is reported to the watch and not to the search."""

    def __init__(self, watch: _Watch, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._watch = watch

    def update(self, seen: Observation, edge: Vector, is_likely: bool = False) -> tuple[float, bool]:
        _, is_edge = super().update(seen, edge, is_likely)
        self._watch.note(is_edge)
        return 0.0, False

    def learn(self, edge: Vector) -> None:
        self._watch.slide()
        super().learn(edge)


def watch(config: CellConfig, has_hole: bool, seed: int) -> HoleEventRow:
    """Let the search of this seed slide without a stop, and again with stops if an event was false."""
    cell = _cell(config, has_hole, seed)
    params = cell.config.params(SEARCH)
    seer = _Watch(cell, has_hole)
    with opened(cell):
        _search(
            cell,
            cell.context(seed),
            lambda ctx: spray_search.run(params, ctx, make_evidence=partial(_Unheeded, seer)),
            seer,
        )
    fell = seer.has_fallen and not seer.began_in_hole
    late = fell and math.isnan(seer.falsely)
    row = HoleEventRow(
        seed=seed,
        has_hole=has_hole,
        slid=seer.slid,
        falsely=seer.falsely,
        fell=fell,
        delay=seer.delay if late else math.nan,
    )
    return row if has_hole or math.isnan(row.falsely) else _judged(config, row)


def _judged(config: CellConfig, row: HoleEventRow) -> HoleEventRow:
    """Return the row with the result of a search of the same plate that obeys its detector."""
    cell = _cell(config, False, row.seed)
    kept: list[SpraySearchResult] = []

    def run(ctx: SkillContext) -> SpraySearchResult:
        kept.append(spray_search.run(cell.config.params(SEARCH), ctx))
        return kept[-1]

    with opened(cell):
        _search(cell, cell.context(row.seed), run)
    return replace(row, rests=kept[-1].rests, found=kept[-1].outcome is Outcome.SUCCESS) if kept else row


def _search(
    cell: Cell, ctx: SkillContext, run: Callable[[SkillContext], SpraySearchResult], seer: _Watch | None = None
) -> None:
    """Grasp and search; a fault ends the search."""
    records = GRASP.run(cell.config.skill_set(), ctx)
    if seer is not None:
        ctx.callbacks = replace(ctx.callbacks, record=seer.record, poll=seer.poll)
    try:
        if records[-1].result.outcome is Outcome.SUCCESS:
            run_stage("spray_search", run, ctx)
    except CellError:
        return


def _cell(config: CellConfig, has_hole: bool, seed: int) -> Cell:
    assert config.sim is not None
    plate = config.sim.plate.model_copy(update={"present": has_hole})
    sim = config.sim.model_copy(update={"seed": seed, "pace": "max", "plate": plate})
    return assemble(config.model_copy(update={"sim": sim}))


@dataclass(frozen=True, slots=True)
class EventLine:
    """All searches; times in s, NaN if there is no value."""

    searches: int
    """Number of searches without a hole."""
    stopped: int
    """Number of those searches with a false event."""
    probes: int
    """Number of their stops, judged at rest."""
    finds: int
    """Number of searches that reported a hole at such a point."""
    falls: int
    """Number of drops without an earlier false event."""
    detected: int
    """Number of those drops with an event within the window."""
    delay: float
    """Median time from the start of the drop to the event, s."""
    delay_p95: float


def line_of(rows: Sequence[HoleEventRow]) -> EventLine:
    """Return the counts of all searches."""
    empty = [row for row in rows if not row.has_hole]
    fell = [row for row in rows if row.is_fall]
    delays = known(row.delay for row in fell)
    return EventLine(
        searches=len(empty),
        stopped=len(known(row.falsely for row in empty)),
        probes=sum(row.rests for row in empty),
        finds=sum(row.found for row in empty),
        falls=len(fell),
        detected=len(delays),
        delay=quantile(delays, 0.5),
        delay_p95=quantile(delays, 0.95),
    )


def run(args: argparse.Namespace) -> StudyReport:
    """Search with and without a hole, and write the table."""
    config, folder = load_simulated(args).cell, out_folder(args.out)
    if args.quick:
        # Timeout of a search with --quick, s.
        config = config.with_params(SEARCH, timeout=min(config.params(SEARCH).timeout, 8.0))
    seeds = seeds_of(args, 1000, 4)
    # Largest number of seeds that also run on a plate with a hole.
    jobs = [(config, has_hole, seed) for has_hole in (False, True) for seed in seeds[: 200 if has_hole else None]]
    rows = each_of(watch, jobs, args.workers, "searches")
    line = line_of(rows)
    title = f"{len(seeds)} searches of {config.params(SEARCH).timeout:g} s without a hole, {line.falls} falls, from seed {seeds[0]}"
    columns: Columns = {
        "stopped by a false event": lambda line: share(line.stopped, line.searches),
        "probes": lambda line: f"{line.probes}",
        "false finds": lambda line: share(line.finds, line.searches),
        "falls detected": lambda line: share(line.detected, line.falls),
        "delay (s), p95": lambda line: f"{line.delay:.2f}, {line.delay_p95:.2f}",
    }
    caption = f"an event within {WINDOW:g} s of the start of a fall is its detection"
    shown = table(title, {"searches": lambda line: str(line.searches)}, columns, [line], caption)
    return reported(shown, folder, {"events.csv": rows}, title=title, line=line, rows=rows)
