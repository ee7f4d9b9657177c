"""Bound of each phase beside the results of a case's trials; without side effects."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cell.config.cell_config import CellConfig
from cell.lab.limits.bounds import Cover, Dip, Down, Upright, critical_damping, fall_time, turn_time
from cell.lab.limits.cases import AREA, Case
from cell.lab.limits.measure import LimitsRow, Pass, Turn, searching
from cell.records.statistics import Z95
from drivers.quantities import Vector
from sim.metering import OVER_FORCE
from skills.catalogue import ADJUST
from skills.contract import Outcome
from skills.play import allowed_tilt
from skills.search.course import leading
from skills.spiral_adjust import ARRIVING

SETTLED = 5e-4
"""Distance from the seated depth at which a downward motion ends, m."""
BETWEEN = 2e-3
"""Depth from which a peg is between the walls and no longer over the rim, m."""
STILL = 2e-3
"""Speed down the hole below which a peg is at rest, m/s."""
NEAR = 1e-3
"""Distance from the seated depth within which a downward motion is at its end, m."""
OVER = 3
"""Number of scans for the computation of that speed."""
RATE_TIME = 0.05
"""Time for the computation of the initial tilt rate of a downward motion, s."""


@dataclass(frozen=True, slots=True)
class LimitsLine:
    """One phase of one case."""

    case: str
    phase: str
    unit: str
    count: int
    """Number of trials or passes in the result."""
    bound: float
    """Bound, in the unit; the median over the trials if it differs between them."""
    reached: float
    """Result of the trials: the estimate of the cover, otherwise the median."""
    spread: tuple[float, float]
    """Ends of the 95 % interval of the cover, otherwise 5th and 95th percentile."""
    told: str
    """Meaning of the bound, with its figures."""


@dataclass(frozen=True, slots=True)
class Study:
    """Rows and configs of a case."""

    case: Case
    config: CellConfig
    rows: Sequence[LimitsRow]

    @property
    def good(self) -> list[LimitsRow]:
        """Rows of seated pegs."""
        return [row for row in self.rows if row.outcome == Outcome.SUCCESS]

    @property
    def passes(self) -> list[Pass]:
        """Passes over the hole of all trials."""
        return [each for row in self.rows for each in row.passes]

    @property
    def mass(self) -> float:
        """Median mass of the hand at the tilted peg's lowest point, kg; NaN without passes."""
        return _median([each.mass for each in self.passes])

    @property
    def shift(self) -> float:
        """Distance from the centre of the lanes' planned band to the centre of the capture band, m.

        The planned band refers to a peg at rest at the depth `fall`, the capture band to a peg at the dip threshold.
        """
        search, reach = searching(self.config), self.config.job().peg.part.reach
        told, laid = (leading(reach, search.tilt, depth) for depth in (search.dip_threshold, search.fall))
        return told - laid

    def aside(self, each: Pass) -> float:
        """Return the distance of a pass from the centre of the capture band, m."""
        return abs(each.offset + self.shift)

    def dip(self, mass: float | None = None) -> Dip:
        """Return the conditions of a drop in this case, for a hand of this mass, kg, or the median one."""
        search, job = searching(self.config), self.config.job()
        return Dip(
            hole=job.hole.part.inscribed,
            peg=job.peg.part.thickness,
            tilt=search.tilt,
            depth=search.dip_threshold,
            push=search.push_stiffness * search.push_offset,
            mass=self.mass if mass is None else mass,
        )

    def cover(self) -> Cover:
        """Return the fastest cover of the whole area by a peg with the search of this case."""
        return self.dip().shortest((AREA, AREA))

    def searched(self) -> tuple[float, float]:
        """Return the measured time of a cover, s, and half its 95 % interval: the sum of all times divided by that of
        all shares.

        Trials that missed the hole contribute all their time and the share before the hole; the interval is that of a
        ratio.
        """
        pairs = np.array([(row.search_time, row.share) for row in self.rows if row.search_time and row.share])
        if len(pairs) < 2:
            return math.nan, math.nan
        times, shares = pairs.T
        ratio = float(times.sum() / shares.sum())
        errors = times - ratio * shares
        return ratio, Z95 * float(np.std(errors, ddof=1)) / (math.sqrt(len(pairs)) * float(shares.mean()))

    def down(self, row: LimitsRow, is_damped: bool = True) -> Down:
        """Return the push down the hole in a trial, with the law's damping or without."""
        assert row.way is not None
        adjust = self.config.params(ADJUST)
        damping = adjust.push_damping_ratio * critical_damping(adjust.push_stiffness, row.way.mass)
        push = adjust.push_stiffness * adjust.push_offset
        return Down(push, row.way.mass, damping if is_damped else 0.0, adjust.arrival if is_damped else 0.0, ARRIVING)

    def descent(self, row: LimitsRow, walls: bool = False, is_damped: bool = True) -> tuple[Vector, Vector]:
        """Return times and depths of a trial's downward motion without walls, or with walls during the righting of the hand."""
        assert row.way is not None
        first, end = row.way.scans[0][1], self.config.hole.depth
        down = self.down(row, is_damped)
        if not walls:
            return down.descent(first, end)
        upright, part, bore = self.upright(row), self.config.job().peg.part, self.config.job().hole.part
        return down.descent(first, end, lambda time: upright.deepest(time, part.thickness, bore.thickness))

    def upright(self, row: LimitsRow) -> Upright:
        """Return the righting of a trial's hand by its stiffness from the end of the insertion."""
        assert row.way is not None
        scans = row.way.scans
        later = next((scan for scan in scans if scan[0] >= scans[0][0] + RATE_TIME), scans[-1])
        rate = (later[2] - scans[0][2]) / max(later[0] - scans[0][0], 1e-6)
        return Upright(scans[0][2], rate, self.config.params(ADJUST).gains.rotation, row.way.moment)

    def seated_after(self, row: LimitsRow) -> float:
        """Return the time after which the peg of a trial was seated, s; NaN if it never was."""
        assert row.way is not None
        end = self.config.hole.depth - SETTLED
        return next((time for time, depth, *_ in row.way.scans if depth >= end), math.nan)

    def scans(self) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
        """Return depth, m, and tilt, rad, in all scans of moving pegs, and in those of pegs at rest; without those at the bottom."""
        moving: list[tuple[float, float]] = []
        still: list[tuple[float, float]] = []
        for row in self.rows:
            scans = row.way.scans if row.way is not None else ()
            for (since, above, _), (until, below, lean) in zip(scans, scans[OVER:], strict=False):
                if below < self.config.hole.depth - NEAR and until > since:
                    (still if below - above < STILL * (until - since) else moving).append((below, lean))
        return moving, still

    def turns(self) -> list[Turn]:
        """Return the rotations of the seated trials."""
        return [row.turn for row in self.good if row.turn is not None]

    def lines(self) -> list[LimitsLine]:
        """Return the lines of this case."""
        return [
            line
            for line in (self._cover(), self._band(), self._fall(), self._turn(), *self._down(), self._jam())
            if line.count
        ]

    def _line(self, phase: str, unit: str, bounds: Sequence[float], found: Sequence[float], told: str) -> LimitsLine:
        values = np.array([value for value in found if math.isfinite(value)])
        low, high = np.quantile(values, (0.05, 0.95)) if len(values) else (math.nan, math.nan)
        median = _median(list(values))
        return LimitsLine(
            self.case.name, phase, unit, len(values), _median(bounds), median, (float(low), float(high)), told
        )

    def _cover(self) -> LimitsLine:
        reached, error = self.searched()
        line = self._line("cover of the area", "s", [], [], "")
        if not math.isfinite(reached) or not self.case.is_preset:
            return line
        best = self.cover()
        laid = _median([row.cover for row in self.rows if row.cover])
        told = f"{best.lanes} lanes at {best.speed:.3f} m/s; as laid {laid:.1f} s"
        count = sum(bool(row.search_time and row.share) for row in self.rows)
        return replace(
            line, count=count, bound=best.time, reached=reached, spread=(reached - error, reached + error), told=told
        )

    def _band(self) -> LimitsLine:
        noticed = [each for each in self.passes if each.is_noticed]
        missed = [each for each in self.passes if not each.is_noticed]
        dip = self.dip()
        speed = _median([each.speed for each in noticed])
        reached = [1e3 * self.aside(each) for each in noticed]
        inside = sum(2 * self.aside(each) < dip.band(each.speed) for each in missed)
        told = f"at {speed:.3f} m/s over the rim; {len(missed)} missed, {inside} of them within the band"
        return self._line("fall noticed off the middle", "mm", [5e2 * dip.band(speed)], reached, told)

    def _fall(self) -> LimitsLine:
        dip = self.dip()
        found, bounds = [], []
        for each in (each for each in self.passes if each.is_noticed and each.push > 0.0):
            found.append(1e3 * crossed(each.fall, dip.depth))
            bounds.append(1e3 * fall_time(dip.depth, each.push, each.mass))
        return self._line(
            f"fall by {1e3 * dip.depth:g} mm", "ms", bounds, found, f"{dip.push:g} N on {self.mass:.1f} kg"
        )

    def _turn(self) -> LimitsLine:
        turns = self.turns()
        bounds = [turn_time(OVER_FORCE, each.angle, each.coupling, each.push) for each in turns]
        told = f"with {OVER_FORCE:g} N at the wall; reached with {_median([each.force for each in turns]):.1f} N"
        return self._line("turn in the hole", "s", bounds, [each.time for each in turns], told)

    def _down(self) -> list[LimitsLine]:
        rows = [row for row in self.good if row.way is not None and len(row.way.scans) > 1]
        found = [self.seated_after(row) for row in rows]
        bounds = {
            "push against inertia": [float(self.descent(row, is_damped=False)[0][-1]) for row in rows],
            "and the law's damping": [float(self.descent(row)[0][-1]) for row in rows],
            "and a hand that comes upright": [float(self.descent(row, walls=True)[0][-1]) for row in rows],
        }
        return [self._line("way down", "s", times, found, told) for told, times in bounds.items()]

    def _jam(self) -> LimitsLine:
        peg, bore = self.config.job().peg.part.thickness, self.config.job().hole.part.thickness
        moving, still = self.scans()
        shares = [lean / allowed_tilt(depth, peg, bore) for depth, lean in still if depth > BETWEEN]
        told = f"lean that both walls allow; slower than {1e3 * STILL:g} mm/s in {len(still)} of {len(still) + len(moving)} scans"
        return self._line("lean of a peg that stands still", "of it", [1.0], shares, told)


def crossed(fall: Sequence[tuple[float, float]], depth: float) -> float:
    """Return the time at which a drop first reached a depth, m, s; NaN if it did not.

    Between scans the square root of the depth is interpolated linearly.
    """
    before, root = 0.0, 0.0
    for time, deep in fall:
        here = math.sqrt(max(deep, 0.0))
        if deep >= depth:
            return before + (math.sqrt(depth) - root) / max(here - root, 1e-9) * (time - before)
        before, root = time, here
    return math.nan


def studies(tried: Sequence[Case], configs: Mapping[str, CellConfig], rows: Sequence[LimitsRow]) -> list[Study]:
    """Return the cases with rows."""
    found = [Study(case, configs[case.name], [row for row in rows if row.case == case.name]) for case in tried]
    return [study for study in found if study.rows]


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if len(values) else math.nan
