"""False and true hole events: share of searches that stop on a plate without a hole, and delay on a plate with one.

A search slides over the plate without a stop, while both detectors run: the dip of the tip, which the cell uses, and
the change of the skin's average from [gibbons]. Up to its first event, a search that obeys a detector follows the same
path, so that one run covers all thresholds. Seeds with a dip at the threshold in use run again with stops, to measure
the result of the judgement at rest.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from functools import lru_cache, partial

import numpy as np

from cell.config.cell_config import CellConfig
from cell.config.load import load
from cell.devices.assembly import Cell, assemble, opened
from cell.lab.workers import on_processes
from cell.peg.ending import ending_of
from drivers.errors import CellError, ConfigError
from drivers.frames import end_point
from drivers.quantities import ImpedanceSetpoint, Vector
from skills import spray_search
from skills.catalogue import GRASP, SEARCH
from skills.contract import Observation, Outcome, Reason, Request, SkillContext
from skills.flow import run_stage
from skills.paper.hole_event import HoleEvent
from skills.search.feel import FAINT
from skills.spray_search import SpraySearchResult
from skills.surface import Plane, SurfaceEstimate

HEIGHT, SKIN = "height", "skin"
DETECTORS = (HEIGHT, SKIN)
"""Names of the detectors: dip of the tip, and change of the skin's average."""
OVER = 5e-5
"""Depth of the peg's lowest point below the plate from which it is over the hole, m; the plate's contacts yield by a
hundredth of it."""
FALL = 2e-4
"""Smallest depth of a drop, m; shallower passes over the hole's edge are ignored."""
WINDOW = 1.0
"""Time after the start of a drop in which an event is its detection, s."""

High = tuple[float, float, float]
"""Time since the start of sliding or since the drop, s; largest value so far; path of the peg's edge since then, m."""


@lru_cache
def printed_threshold() -> float:
    """Return the change of the average at which the printed search detects the hole, fraction."""
    paper = load(preset="paper").cell.paper
    assert paper is not None
    return paper.search.threshold


@dataclass(slots=True)
class Highs:
    """Times at which a detector's value exceeded all earlier values; they determine the result at any threshold."""

    values: list[High] = field(default_factory=list)

    def note(self, time: float, value: float, way: float = 0.0) -> None:
        """Add one value."""
        if value > (self.values[-1][1] if self.values else 0.0):
            self.values.append((time, value, way))

    def first(self, limit: float) -> High | None:
        """Return the first entry beyond `limit`."""
        return next((high for high in self.values if high[1] > limit), None)

    @property
    def largest(self) -> float:
        """Return the largest value, or 0."""
        return self.values[-1][1] if self.values else 0.0


@dataclass(slots=True)
class Watched:
    """Record of one search without a stop."""

    seed: int
    has_hole: bool
    ended: str = ""
    """Reason why the search ended early; empty if it continued to the timeout or to the end of the window."""
    slid: float = 0.0
    """Time of sliding, s; with a hole, until the drop."""
    spread: float = 0.0
    """Standard deviation of the height about the estimated surface, m."""
    crossings: float = 0.0
    """Rate at which the height passes its median upwards, 1/s."""
    before: dict[str, Highs] = field(default_factory=dict)
    """Highs of every detector during sliding over solid plate."""
    after: dict[str, Highs] | None = None
    """Highs of every detector after the drop; None if the peg never dropped."""
    began_in_hole: bool = False
    """True if the peg came down in the hole, so that there is no drop."""


@dataclass(frozen=True, slots=True)
class Listened:
    """Record of one search on a plate without a hole that stops on its evidence."""

    seed: int
    rests: int
    """Number of false probes."""
    found: bool
    """True if the search reported a hole."""


class _Watch:
    """Records all data of a search, and the truth."""

    def __init__(self, cell: Cell, row: Watched) -> None:
        self.row = row
        self.seen: Observation | None = None
        self._cell, self._part, self._length = cell, cell.config.peg.part, cell.config.peg.length
        self._event: HoleEvent | None = None
        self.heights: list[float] = []
        self._start: float | None = None
        self._over: float | None = None
        self._place, self._deepest, self._way = np.zeros(3), 0.0, 0.0
        self.is_done = False
        row.before = {name: Highs() for name in DETECTORS}

    def record(self, seen: Observation, setpoint: ImpedanceSetpoint | None) -> None:
        self.seen = seen
        if self._event is not None and seen.is_new_frame:
            self._note(SKIN, self._event.change(seen.frame))

    def poll(self) -> Request:
        return Request.STOP if self.is_done else Request.RUN

    def slide(self) -> None:
        """Record the start of sliding."""
        if self._start is None:
            assert self.seen is not None
            self._start, self._event = self.seen.stamp, HoleEvent(printed_threshold())

    def height(self, below: float) -> None:
        """Record the larger of dip and drop of one scan; the last call of a scan."""
        assert self.seen is not None
        if self._start is None:
            return
        if self.row.has_hole:
            self._compare(self._start)
        self._note(HEIGHT, below)
        if self._over is None:
            self.heights.append(below)
            self.row.slid = self.seen.stamp - self._start

    def _compare(self, start: float) -> None:
        """Check in the truth for the start of a drop."""
        assert self.seen is not None
        truth, now = self._cell.truth(), self.seen.stamp  # type: ignore[misc]
        _, axis = end_point(self.seen.arm.tcp, truth.theta, self._length)
        edge = self._part.lowest(np.array(truth.tip), axis, self.seen.arm.tcp.rotation[:, 2])
        depth = truth.depth + truth.tip[2] - edge[2]
        if self._over is None and depth > OVER:
            self.row.began_in_hole = now - start < 0.05
            self._over, self._place, self._deepest = now, edge, 0.0
            self.row.after = {name: Highs() for name in DETECTORS}
        if self._over is not None:
            self._deepest = max(self._deepest, depth)
            self._way = float(np.linalg.norm((edge - self._place)[:2]))
            if now - self._over >= WINDOW:
                self.is_done = self._deepest >= FALL
                if not self.is_done:
                    self.row.after = None
                self._over = None

    def _note(self, name: str, value: float) -> None:
        assert self.seen is not None
        if self._start is None:
            return
        if self._over is not None and self.row.after is not None:
            self.row.after[name].note(self.seen.stamp - self._over, value, self._way)
        else:
            self.row.before[name].note(self.seen.stamp - self._start, value)


class _StillSurface(SurfaceEstimate):
    """Surface estimate that reports every dip to the watch and none to the search."""

    def __init__(self, watch: _Watch) -> None:
        super().__init__()
        self._watch, self._learnt, self._fallen = watch, SurfaceEstimate(), -math.inf

    def learn(self, edge: Vector, sense: int) -> None:
        self._watch.slide()
        self._learnt.learn(edge, sense)

    def below(self, edge: Vector, sense: int) -> float:
        self._watch.height(max(self._learnt.below(edge, sense), self._fallen))
        self._fallen = -math.inf
        return 0.0

    def dip(self, edge: Vector, sense: int) -> float:
        return self._learnt.dip(edge, sense)

    @property
    def knows_slopes(self) -> bool:
        return self._learnt.knows_slopes

    def fallen(self, before: Vector, edge: Vector) -> float:
        self._fallen = max(self._fallen, self._learnt.fallen(before, edge) / FAINT)
        return 0.0

    def plane(self, near: Vector) -> Plane:
        return self._learnt.plane(near)


def watch(config: CellConfig, has_hole: bool, seed: int) -> Watched:
    """Let the search of this seed slide without a stop, while every detector runs."""
    row = Watched(seed, has_hole)
    cell = _cell(config, has_hole, seed)
    params = cell.config.params(SEARCH)
    with opened(cell):
        ctx = cell.context(seed)
        seer = _Watch(cell, row)
        outcome, reason = _search(
            cell,
            ctx,
            lambda c: spray_search.run(params, c, _StillSurface(seer)),
            seer,
        )
    if not seer.is_done and reason is not Reason.NO_HOLE:
        row.ended = f"{outcome} {reason.name.lower()}"
    if not seer.is_done:
        row.after = None
    heights = np.array(seer.heights)
    if heights.size:
        swing = heights - np.median(heights)
        row.spread = float(swing.std())
        seconds = heights.size / cell.config.scan_rate
        row.crossings = float(np.count_nonzero((swing[:-1] < 0.0) & (swing[1:] >= 0.0)) / seconds)
    return row


def listen(config: CellConfig, seed: int) -> Listened:
    """Run the search of this seed on a plate without a hole."""
    cell = _cell(config, False, seed)
    kept: list[SpraySearchResult] = []

    def run(ctx: SkillContext) -> SpraySearchResult:
        kept.append(spray_search.run(cell.config.params(SEARCH), ctx))
        return kept[-1]

    with opened(cell):
        _search(cell, cell.context(seed), run)
    rests = kept[-1].rests if kept else 0
    return Listened(seed, rests, bool(kept) and kept[-1].outcome is Outcome.SUCCESS)


def _search(
    cell: Cell, ctx: SkillContext, run: Callable[[SkillContext], SpraySearchResult], seer: _Watch | None = None
) -> tuple[str, IntEnum]:
    """Grasp and search; return the search's result."""
    fault: CellError | None = None
    records = GRASP.run(cell.config.skill_set(), ctx)
    if seer is not None:
        ctx.record, ctx.poll = seer.record, seer.poll
    try:
        if records[-1].result.outcome is Outcome.SUCCESS:
            records.append(run_stage("spray_search", run, ctx))
    except CellError as error:
        fault = error
    ending = ending_of(records[-1:], fault, ctx.stage)
    return ending.outcome, ending.reason


def _cell(config: CellConfig, has_hole: bool, seed: int) -> Cell:
    assert config.sim is not None
    plate = config.sim.plate.model_copy(update={"present": has_hole})
    sim = config.sim.model_copy(update={"seed": seed, "pace": "max", "plate": plate})
    return assemble(config.model_copy(update={"sim": sim}))


def measure(
    config: CellConfig,
    seeds: Sequence[int],
    with_hole: int,
    workers: int,
    done: Callable[[], None],
) -> list[Watched]:
    """Watch a search of every seed without a hole, and of the first `with_hole` seeds with one.

    Args:
        config: Config of the cell.
        seeds: Seeds, one search each.
        with_hole: Number of seeds that also run on a plate with the hole.
        workers: Number of processes.
        done: Called after every search.

    Raises:
        ConfigError: The cell is not simulated, or its plate must have a hole.
    """
    if config.sim is None or config.sim.model.hole not in ("exact", "unpredicted"):
        raise ConfigError('study events: needs a simulated cell with sim.model.hole = "exact"')
    rows: list[Watched] = []
    for has_hole, some in ((False, seeds), (True, seeds[:with_hole])):
        for row in on_processes(partial(watch, config, has_hole), some, workers):
            rows.append(row)
            done()
    return sorted(rows, key=lambda row: (row.has_hole, row.seed))


def rice_limit(row: Watched, false_alarms: float, horizon: float) -> float:
    """Return the dip exceeded at this rate by the height's own spread in a search of this length, m.

    [rice]: a normal process passes the level u upwards crossings·exp(-u²/2 spread²) times a second.
    """
    passes = max(row.crossings * horizon / false_alarms, 1.0 + 1e-9)
    return row.spread * math.sqrt(2.0 * math.log(passes))


def rice_chance(row: Watched, dip: float) -> float:
    """Return the probability that the height exceeds the dip, m, during the sliding time, by the same formula."""
    if row.spread == 0.0:
        return 0.0
    return -math.expm1(-row.crossings * row.slid * math.exp(-0.5 * (dip / row.spread) ** 2))
