"""False and true hole events: number of stops of a search on a plate without a hole, and delay in the detection of a drop.

A search slides over the plate without a stop, while its detector runs. Up to the first event, a search that obeys the
detector follows the same path. If the detector reports an event on a plate without a hole, the seed runs again with stops,
to measure the result of the judgement at rest.
"""

import argparse
import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

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
from drivers.quantities import Vector
from skills.catalogue import GRASP, SEARCH
from skills.contract import Observation, Outcome, Request, SkillContext, SkillResult
from skills.flow import Step, run_stage
from skills.search import spray_search
from skills.search.feel import EdgeEvidence
from skills.search.params import SpraySearchParams
from skills.search.spray_search import SpraySearchResult
from skills.search.surface import SurfaceEstimate

WINDOW = 1.0
"""Time after the start of a drop within which an event counts as its detection, s."""


@dataclass(frozen=True, slots=True)
class HoleEventRow:
    """One search without a stop; times in s, NaN if there is no value."""

    seed: int
    has_hole: bool
    slid: float
    """Time of sliding, s; on a plate with a hole, until the drop."""
    falsely: float
    """Time of sliding until the first event over solid plate, s."""
    fell: bool
    """True if the peg dropped into the hole while it slid."""
    delay: float
    """Time from the start of the drop to its event, s."""
    rests: int = 0
    """Number of stops of the second search, which obeys its detector on the same plate; 0 if there was no false event."""
    found: bool = False
    """True if the second search reported a hole, although the plate has none."""

    @property
    def is_fall(self) -> bool:
        """True if the peg dropped without an earlier false event."""
        return self.fell and math.isnan(self.falsely)


class _Watch(EdgeEvidence):
    """Evidence that is recorded but not reported to the search, and the true drop of the peg."""

    def __init__(self, cell: Cell, has_hole: bool, params: SpraySearchParams, ctx: SkillContext) -> None:
        super().__init__(params, SurfaceEstimate(), ctx.schedule.period)
        self.is_done, self.has_fallen, self.began_in_hole = False, False, False
        self.slid = 0.0
        self.falsely = self.delay = math.nan
        self._cell, self._has_hole = cell, has_hole
        self._now = 0.0
        self._start: float | None = None
        self._over: float | None = None
        self._deepest = 0.0

    def poll(self) -> Request:
        return Request.STOP if self.is_done else Request.RUN

    def learn(self, edge: Vector) -> None:
        """Record the start of sliding."""
        if self._start is None:
            self._start = self._now
        super().learn(edge)

    def update(self, seen: Observation, edge: Vector, is_likely: bool = False) -> tuple[float, bool]:
        """Record if there is evidence of an edge, and report none to the search; the first call of a scan."""
        _, is_edge = super().update(seen, edge, is_likely)
        self._now = seen.stamp
        if self._start is not None:
            if self._has_hole:
                self._compare(seen, self._start)
            if self._over is None:
                self.slid = self._now - self._start
                if is_edge and math.isnan(self.falsely):
                    self.falsely = self.slid
            elif is_edge and math.isnan(self.delay):
                self.delay = self._now - self._over
        return 0.0, False

    def _compare(self, seen: Observation, start: float) -> None:
        """Detect a drop from the true state."""
        truth, now = self._cell.truth(), seen.stamp  # type: ignore[misc]
        _, axis = end_point(seen.arm.tcp, truth.theta, self._cell.config.peg.length)
        edge = self._cell.config.peg.part.lowest(np.array(truth.tip), axis, seen.arm.tcp.rotation[:, 2])
        depth = truth.depth + truth.tip[2] - edge[2]
        # Depth of the peg's lowest point below the plate above which the point is over the hole, m; the plate's contacts
        # yield by a hundredth of this depth.
        if self._over is None and depth > 5e-5:
            # Time since the start of sliding, s; if it is shorter, the peg came down in the hole and there is no drop.
            self.began_in_hole = now - start < 0.05
            self._over, self._deepest, self.delay = now, 0.0, math.nan
        if self._over is None:
            return
        self._deepest = max(self._deepest, depth)
        if now - self._over >= WINDOW:
            # Smallest depth of a drop, m; shallower passes over the hole's edge are ignored.
            self.is_done = self.has_fallen = self._deepest >= 2e-4
            self._over = None


def watch(config: CellConfig, has_hole: bool, seed: int) -> HoleEventRow:
    """Run the search of this seed without stops; if there was an event on a plate without a hole, run it again with stops."""
    cell = _cell(config, has_hole, seed)
    params = cell.config.params(SEARCH)
    with opened(cell):
        ctx = cell.context(seed)
        seer = _Watch(cell, has_hole, params, ctx)
        _search(cell, ctx, lambda ctx: spray_search.run(params, ctx, make_evidence=lambda *given: seer), seer.poll)
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
    with opened(cell):
        ctx = cell.context(row.seed)
        found = _search(cell, ctx, lambda ctx: spray_search.run(cell.config.params(SEARCH), ctx), ctx.callbacks.poll)
    if not isinstance(found, SpraySearchResult):
        return row
    return replace(row, rests=found.rests, found=found.outcome is Outcome.SUCCESS)


def _search(cell: Cell, ctx: SkillContext, run: Step, poll: Callable[[], Request]) -> SkillResult | None:
    """Grasp and search, and return the result; None after a failed grasp or a fault."""
    records = GRASP.run(cell.config.skill_set(), ctx)
    ctx.callbacks = replace(ctx.callbacks, poll=poll)
    with suppress(CellError):
        if records[-1].result.outcome is Outcome.SUCCESS:
            return run_stage("spray_search", run, ctx).result
    return None


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
    """Number of these searches with a false event."""
    probes: int
    """Number of stops in the second runs of these searches, judged at rest."""
    finds: int
    """Number of second runs that reported a hole at such a stop."""
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
