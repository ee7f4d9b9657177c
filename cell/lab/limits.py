"""Limits of each phase of an insertion: the bound from sizes, forces and masses, compared with the time in trials.

A probe observes the true state in each trial, and computes the bounds with the masses of that trial.
"""

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cell.devices.assembly import Cell
from cell.lab.arguments import load_simulated, seeds_of
from cell.lab.bounds import Dip, Down, Upright, critical_damping, mobility, turn_time, turning_force
from cell.lab.charts import BLUE, RED, Curve, Panel, draw_panels
from cell.lab.compare import chosen, compared, section
from cell.lab.report import StudyReport, reported
from cell.lab.rows import quantile, successes
from cell.lab.tables import Columns, table
from cell.lab.trials import Probe, TrialRow
from drivers.frames import angle_between
from drivers.quantities import ImpedanceSetpoint, Vector
from sim.world.metering import OVER_FORCE
from sim.world.physics import World
from skills.catalogue import ADJUST, INSERT, SEARCH
from skills.contract import Observation, SkillContext
from skills.flow import StageRecord
from skills.insert.spiral_adjust import ARRIVING
from skills.paths import Lanes
from skills.search.spray_search import SpraySearchResult

COVER, TURN, DOWN, DAMPED, WALLS = (
    "cover of the area",
    "turn in the hole",
    "way down",
    "way down, damped",
    "way down, damped, walls",
)
"""Names of the phases and bounds. The last two bounds add the law's damping; the last one also adds walls, which let the peg down
only as far as the tilt of the hand permits."""


class Phases(Probe):
    """Observes the phases of a trial by the true state."""

    def __init__(self, cell: Cell, ctx: SkillContext) -> None:
        """Begin without observations."""
        super().__init__(cell, ctx)
        world = getattr(cell.truth, "__self__", None)
        assert isinstance(world, World)
        self._world = world
        self._stage, self._began = "", 0.0
        self._mass = math.nan
        """Effective mass of the hand along the normal at the peg's lowest point in the search, kg."""
        self._tilts: list[tuple[float, float]] = []
        """Time, s, and tilt from the hole's axis, rad, of each scan of the insertion."""
        self._coupling, self._push = math.nan, math.nan
        """Wall force per angular acceleration about the tip, N per rad/s², and push of the insertion, N."""
        self._scans: list[tuple[float, float, float]] = []
        """Time, s, depth of the tip, m, and tilt, rad, of each scan of the adjustment."""
        self._inertia = np.eye(6)
        self._about = np.array([1.0, 0.0, 0.0])

    def record(self, seen: Observation, setpoint: ImpedanceSetpoint | None) -> None:
        """Add one scan."""
        stage, world = self._ctx.stage, self._world
        if stage != self._stage:
            self._stage, self._began = stage, world.now()
            if stage == INSERT.name:
                self._tilts, self._push = [], math.nan
            elif stage == ADJUST.name:
                self._scans = []
        if not world.is_held or stage not in (SEARCH.name, INSERT.name, ADJUST.name):
            return
        tip, axis, normal = world.end(), world.peg_pose().rotation[:, 2], world.plate.rotation[:, 2]
        if stage == SEARCH.name:
            if math.isnan(self._mass):
                place = self._ctx.job.peg.part.lowest(tip, axis, world.tcp().rotation[:, 2])
                self._mass = mobility(world.inertia(place), normal)
        elif stage == INSERT.name:
            self._turn(tip, axis, normal, setpoint)
        else:
            if not self._scans:
                self._inertia, about = world.inertia(tip), np.cross(axis, normal)
                self._about = about / np.linalg.norm(about)
            depth = -float((world.plate.rotation.T @ (tip - world.plate.position))[2])
            self._scans.append((world.now() - self._began, depth, angle_between(axis, normal)))

    def _turn(self, tip: Vector, axis: Vector, normal: Vector, setpoint: ImpedanceSetpoint | None) -> None:
        """Add one scan of the insertion."""
        if not self._tilts:
            about = np.cross(axis, normal)
            force = turning_force(self._world.inertia(tip), about / np.linalg.norm(about))
            self._coupling = float(np.linalg.norm(force - (force @ normal) * normal))
        if len(self._tilts) == 1 and setpoint is not None:  # the first scan still has the setpoint of the search
            self._push = float(setpoint.stiffness[2]) * self._cell.config.params(INSERT).push_offset
        self._tilts.append((self._world.now(), angle_between(axis, normal)))

    def columns(self, records: Sequence[StageRecord]) -> dict[str, str]:
        """Return time and bound of each phase, s, and the share of the first cover up to the hole; empty if unknown."""
        found = {**self._covered(records), **self._turned(), **self._seated()}
        return {name: "" if math.isnan(value) else f"{value:.7g}" for name, value in found.items()}

    def _covered(self, records: Sequence[StageRecord]) -> dict[str, float]:
        results = [record.result for record in records if isinstance(record.result, SpraySearchResult)]
        path = results[0].left.path if results and results[0].left is not None else None
        share = math.nan
        if isinstance(path, Lanes):
            hole, times = (
                self._world.plate.position[:2] - self._cell.config.hole.centre[:2],
                np.arange(0.0, path.cover, 1e-3),
            )
            share = float(min(times, key=lambda time: math.dist(path.at(float(time))[0], hole))) / path.cover
        config, job = self._cell.config, self._cell.config.job()
        search = config.plan().search
        dip = Dip(
            hole=job.hole.part.inscribed,
            peg=job.peg.part.thickness,
            tilt=search.tilt,
            depth=search.dip_threshold,
            push=search.push_stiffness * search.push_offset,
            mass=self._mass,
        )
        bound = math.nan if math.isnan(self._mass) else dip.shortest(config.hole.area).time
        return {f"{COVER}: share": share, f"{COVER}: bound": bound}

    def _turned(self) -> dict[str, float]:
        time = bound = math.nan
        if len(self._tilts) > 1 and self._scans and self._push < OVER_FORCE:
            (begin, first), (end, last) = self._tilts[0], self._tilts[-1]
            time, bound = end - begin, turn_time(OVER_FORCE, max(first - last, 0.0), self._coupling, self._push)
        return {TURN: time, f"{TURN}: bound": bound}

    def _seated(self) -> dict[str, float]:
        end, names = self._cell.config.hole.depth, (DOWN, DAMPED, WALLS)
        # Distance from the seated depth at which a downward motion ends, m.
        time = next((time for time, depth, _ in self._scans if depth >= end - 5e-4), math.nan)
        if len(self._scans) < 2 or math.isnan(time):
            return {DOWN: math.nan, **dict.fromkeys((f"{name}: bound" for name in names), math.nan)}
        job, adjust, depth = self._cell.config.job(), self._cell.config.params(ADJUST), self._scans[0][1]
        mass = mobility(self._inertia, self._world.plate.rotation[:, 2])
        damping = adjust.push_damping_ratio * critical_damping(adjust.push_stiffness, mass)
        push = adjust.push_stiffness * adjust.push_offset
        free, damped = Down(push, mass, 0.0), Down(push, mass, damping, adjust.arrival, ARRIVING)
        upright = self._upright(adjust.gains.rotation)
        peg, hole = job.peg.part.thickness, job.hole.part.thickness
        ways = (
            free.descent(depth, end),
            damped.descent(depth, end),
            damped.descent(depth, end, lambda after: upright.deepest(after, peg, hole)),
        )
        bounds = {f"{name}: bound": float(times[-1]) for name, (times, _) in zip(names, ways, strict=True)}
        return {DOWN: time, **bounds}

    def _upright(self, stiffness: float) -> Upright:
        """Return the motion in which the rotational stiffness, N·m/rad, turns the hand upright, from the start of the adjustment."""
        start = self._scans[0]
        # Time span over which the initial rate of the tilt is measured, s.
        later = next((scan for scan in self._scans if scan[0] >= start[0] + 0.05), self._scans[-1])
        rate = (later[2] - start[2]) / max(later[0] - start[0], 1e-6)
        moment = float(self._about @ self._inertia[3:, 3:] @ self._about)
        return Upright(start[2], rate, stiffness, moment)


@dataclass(frozen=True, slots=True)
class LimitsLine:
    """One phase of one variant; times in s, medians with the 5th and 95th percentile."""

    variant: str
    phase: str
    count: int
    bound: float
    reached: float
    p5: float
    p95: float


def lines_of(variant: str, rows: Sequence[TrialRow]) -> list[LimitsLine]:
    """Return the phases of the successful trials; a whole cover takes the search time divided by the share covered."""
    good = successes(rows)

    def of(name: str) -> list[float]:
        return [float(row.more[name]) for row in good if row.more.get(name)]

    covers = [
        row.search_time / float(share)
        for row in good
        # Smallest share of a cover from which the time of a whole cover is estimated; shorter paths consist mostly of
        # touch-down and rest.
        if row.search_time and (share := row.more[f"{COVER}: share"]) and float(share) > 0.15
    ]
    times = {COVER: covers, TURN: of(TURN), **dict.fromkeys((DOWN, DAMPED, WALLS), of(DOWN))}
    return [
        LimitsLine(
            variant,
            phase,
            len(found),
            quantile(of(f"{phase}: bound"), 0.5),
            *(quantile(found, share) for share in (0.5, 0.05, 0.95)),
        )
        for phase, found in times.items()
    ]


def panel(lines: Sequence[LimitsLine]) -> Panel:
    """Return the panel with bound and result of every phase."""
    phases = list(dict.fromkeys(line.phase for line in lines))
    curves = []
    for number, (name, colour) in enumerate(
        zip(dict.fromkeys(line.variant for line in lines), (BLUE, RED), strict=False)
    ):
        of = [line for line in lines if line.variant == name and line.count]
        figures = np.array([(phases.index(line.phase), line.reached, line.p5, line.p95, line.bound) for line in of])
        x, reached, low, high, bound = figures.reshape(-1, 5).T
        x = x + 1.0 + 0.15 * number
        curves.append(Curve(x, reached, colour, name, "o", low=low, high=high))
        curves.append(Curve(x, bound, colour, f"bound of {name}", "_", 4.5))
    return Panel(
        "symbol: reached, 5 to 95 %; bar: bound",
        "",
        "time (s)",
        curves,
        "y",
        x_ticks=range(1, len(phases) + 1),
        x_names=[phase.replace(" ", "\n") for phase in phases],
        y_ticks=(0.1, 0.2, 0.5, 1, 2, 5, 10, 20),
        x_limits=(0.5, len(phases) + 0.7),
    )


def run(args: argparse.Namespace) -> StudyReport:
    """Run the variants, write bound and result of each phase, draw the chart."""
    load_simulated(args)
    found = compared(args, chosen(args.name, args.quick), seeds_of(args, section(args.name)["trials"]))
    lines = [each for line, rows in zip(found.lines, found.rows, strict=True) for each in lines_of(line.family, rows)]
    columns: Columns = {
        "n": lambda line: f"{line.count}",
        "bound (s)": lambda line: f"{line.bound:.2f}",
        "reached (s)": lambda line: f"{line.reached:.2f}",
        "5 to 95 %": lambda line: f"{line.p5:.2f} to {line.p95:.2f}",
    }
    names: Columns = {"variant": lambda line: line.variant, "phase": lambda line: line.phase}
    shown = table(found.title, names, columns, lines)
    chart = draw_panels([panel(lines)], f"What limits each phase\n{found.title}", found.folder / "limits.png")
    return reported(shown, found.folder, {"limits.csv": lines}, [chart], title=found.title, lines=lines)
