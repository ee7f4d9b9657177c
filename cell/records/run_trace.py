"""Figures from the scans of a run, for its row and the rows of its stages; pure."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields, replace

import numpy as np

from cell.records.schema import RunRow, StageRow, finite
from drivers.errors import CellError
from drivers.parts import Hole
from skills.contract import Observation, Outcome, Reason, SkillResult
from skills.flow import StageRecord
from skills.seating.decision import depth_of


@dataclass(slots=True)
class Visit:
    """One stay in a stage: figures from its scans."""

    name: str
    began: float
    """Beginning of the stay on the cell's clock, s."""
    ended: float
    peak_force: float = 0.0
    deepest: float = -math.inf
    """Largest depth of the held peg's tip over the area of the hole, m; -inf if it was never there."""
    newest: Observation | None = None
    """Last scan with a healthy pose of the peg."""

    def see(self, seen: Observation, hole: Hole) -> None:
        """Add one scan."""
        self.ended, force = seen.stamp, seen.arm.wrench.force
        self.peak_force = max(self.peak_force, math.sqrt(float(force @ force)))
        if not seen.peg.healthy:
            return
        self.newest = seen
        if seen.gripper.is_gripping and _is_over(seen, hole):
            self.deepest = max(self.deepest, depth_of(seen.tip, hole))


@dataclass(slots=True)
class RunTrace:
    """The stays of one run in order."""

    began: float
    """Time of the command on the cell's clock, s."""
    hole: Hole
    visits: list[Visit] = field(default_factory=list)

    def see(self, seen: Observation, stage: str) -> None:
        """Add one scan of a stage."""
        if not self.visits or self.visits[-1].name != stage:
            self.visits.append(Visit(stage, seen.stamp, seen.stamp))
        self.visits[-1].see(seen, self.hole)

    def figures(self, row: RunRow) -> RunRow:
        """Return a run's row, completed with the figures from its scans."""
        last = next((visit.newest for visit in reversed(self.visits) if visit.newest is not None), None)
        return replace(
            row,
            peak_force=max((visit.peak_force for visit in self.visits), default=None),
            deepest=finite(max((visit.deepest for visit in self.visits), default=-math.inf)),
            theta=last.peg.theta if last is not None else None,
            sigma=last.peg.sigma if last is not None else None,
            length=float(np.linalg.norm(last.tip - last.arm.tcp.position)) if last is not None else None,
        )

    def stages(self, run: int, records: Sequence[StageRecord], fault: CellError | None) -> list[StageRow]:
        """Return the rows of the stages: with their results, and behind them those without one, with figures from the scans.

        If the program tried a stage several times in a row, the figures are in the row of the last try.
        """
        rows = [self._answered(run, place, records) for place in range(1, len(records) + 1)]
        later = [visit for visit in self.visits if not any(_is_of(visit, record) for record in records)]
        rows += [self._seen(run, place, visit) for place, visit in enumerate(later, len(rows) + 1)]
        if later and fault is not None:
            rows[-1] = replace(rows[-1], outcome=Outcome.FAULT)
        return rows

    def _seen(self, run: int, place: int, visit: Visit) -> StageRow:
        peg = None if visit.newest is None else visit.newest.peg
        return StageRow(
            run=run,
            place=place,
            name=visit.name,
            began=visit.began - self.began,
            ended=visit.ended - self.began,
            theta=peg.theta if peg is not None else None,
            sigma=finite(peg.sigma) if peg is not None else None,
            residual=peg.residual if peg is not None else None,
            peak_force=visit.peak_force,
            deepest=finite(visit.deepest),
        )

    def _answered(self, run: int, place: int, records: Sequence[StageRecord]) -> StageRow:
        record = records[place - 1]
        is_followed = place < len(records) and records[place].name == record.name
        stays = (visit for visit in reversed(self.visits) if _is_of(visit, record))
        visit = None if is_followed else next(stays, None)
        row = StageRow(run, place, record.name, 0.0, 0.0) if visit is None else self._seen(run, place, visit)
        reason = record.result.reason
        return replace(
            row,
            began=record.started - self.began,
            ended=record.ended - self.began,
            counted=record.result.elapsed,
            outcome=record.result.outcome,
            reason="" if reason is Reason.NONE else reason.name.lower(),
            retried=int(record.retried),
            facts=json.dumps(_facts(record.result), default=_plain),
        )


def _is_of(visit: Visit, record: StageRecord) -> bool:
    """Return True if a stay belongs to the stage of a result, or to an earlier try of it."""
    return visit.name == record.name and visit.began <= record.ended


def _is_over(seen: Observation, hole: Hole) -> bool:
    """Return True if the tip is over the hole's area, with a margin of half the area's size on each side."""
    x, y = seen.tip[0] - hole.centre[0], seen.tip[1] - hole.centre[1]
    return bool(abs(x) <= hole.area[0] and abs(y) <= hole.area[1])


def _facts(result: SkillResult) -> dict[str, object]:
    """Return the fields that a skill adds to its result; numbers that are not finite become None, because JSON cannot express them."""
    common = {each.name for each in fields(SkillResult)}
    told = {name: value for name, value in asdict(result).items() if name not in common}
    return {name: finite(value) if isinstance(value, float) else value for name, value in told.items()}


def _plain(value: object) -> object:
    """Return a value for which JSON has no type: an array as lists of numbers, any other value as text."""
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)
