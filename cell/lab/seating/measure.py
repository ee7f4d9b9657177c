"""Trials of holes without a switch: true seatings and parts mistaken for seated, judged by the cell and, for a skill with false reports, by its gate."""

import csv
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields
from functools import partial
from itertools import takewhile
from pathlib import Path
from statistics import fmean, median
from typing import TYPE_CHECKING

import numpy as np

from cell.config.cell_config import CellConfig
from cell.devices.assembly import assemble, opened
from cell.lab.trials import Watcher
from cell.lab.workers import on_processes
from cell.peg.ending import Ending, ending_of
from cell.peg.part_state import PartState
from cell.peg.success import Evidence, LastLook, judged
from cell.records.statistics import wilson
from drivers.errors import CellError, ConfigError, FaultCode
from drivers.parts import Latch
from drivers.quantities import ImpedanceSetpoint
from plc_bridge.messages import PartPlace
from skills.catalogue import ADJUST, CATALOGUE, GRASP, INSERT, SEARCH
from skills.contract import Observation, Outcome, Reason, SkillContext
from skills.entry import Claim
from skills.flow import StageRecord
from skills.latch_likelihood import GRID, Signature, Way, resistance, told_by
from skills.signature import Curve

if TYPE_CHECKING:
    from sim.truth import Truth

TABLE = "seating.csv"
ON_BOTTOM = 3e-4
"""Largest distance of a seated peg's end from the bottom in the simulation, m."""
LATCHES = {
    "detent": Latch(kind="detent", force=5.0, height=0.003),
    "press": Latch(kind="press", force=5.0, height=0.003),
}
"""Latches by kind; the default push overcomes their force of 5 N."""

AREA, SEARCHED = (0.004, 0.004), 5.0
"""Area that contains the hole, m, and longest search, s; the study begins when the hole is found."""


@dataclass(frozen=True, slots=True)
class Case:
    """One possible final state of a part."""

    name: str
    is_seated: bool
    """True if a part on the bottom is seated; False if its latch is worn out or the bottom is another one."""
    shallow: float = 0.0
    """Height of the real bottom above the stated one, m."""
    wear: float = 0.0
    """Lost share of the latch's force, fraction."""
    has_hole: bool = True


CASES = (
    Case("seated", True),
    Case("bottom 1 mm higher", False, shallow=0.001),
    Case("stuck 3 mm short", False, shallow=0.003),
    Case("worn latch", False, wear=1.0),
    Case("no hole", False, has_hole=False),
)
"""Cases of the study; all except the first must never be judged as seated."""


@dataclass(frozen=True, slots=True)
class SeatingRow:
    """One trial; SI units, empty if the peg did not come to rest."""

    kind: str
    case: str
    seed: int
    outcome: str
    reason: str
    depth: float
    """True depth of the end after the adjustment, m."""
    is_seated: bool
    """True if the part was really seated then."""
    is_told: bool
    """True if the cell reported a success."""
    is_believed: bool
    """True if the gate would have accepted a reported success; the result of a skill with false reports."""
    force: float | None
    """Force of the latch from the last curve that ended at rest, N."""
    offset: float | None
    """Height of the latch above the stated one from the same curve, m."""
    doubt: float | None
    """Share of the likelihood for another force or position, of that curve and the earlier ones, fraction."""
    hanging: float | None
    """Correlation length of that curve's deviations from its own latch, m."""
    ways: int
    """Number of downward motions that ended at rest."""
    max_penetration: float
    is_void: bool


@dataclass(frozen=True, slots=True)
class SeatingLine:
    """One case of one kind of latch."""

    kind: str
    case: str
    trials: int
    seated: int
    """Number of trials with a really seated part."""
    missed: int
    """Number of really seated parts that the cell did not report as seated."""
    false: int
    """Number of parts judged as seated without being so, by the cell or by its gate for a skill with false reports."""
    hanging: float
    """Median correlation length of the deviations of the last curves, m."""
    ways: float
    """Mean number of downward motions."""
    low: float
    high: float
    """Wilson 95 % interval of the errors of this case: missed of the seated ones, or false of all others."""


@dataclass(frozen=True, slots=True)
class Curves:
    """Force against height of one trial, for the picture."""

    kind: str
    case: str
    seed: int
    heights: tuple[float, ...]
    """Heights above the last one, m."""
    forces: tuple[float, ...]


class Recorder:
    """Observes one trial as the gate does, and stores the result of the last curve."""

    def __init__(self, watcher: Watcher, latch: Latch) -> None:
        """Store the watcher of the trial and the stated latch."""
        self.watcher, self.latch = watcher, latch
        self.curve, self.shown = Curve(), Curve()
        self.said: Signature | None = None
        self.proofs: list[Evidence] = []
        """Evidence of a seated peg in some scan; a skill with false reports could have ended there."""
        self.truth: Truth | None = None

    def record(self, seen: Observation, setpoint: ImpedanceSetpoint | None) -> None:
        """Add one scan."""
        self.watcher.record(seen, setpoint)
        if self.watcher.ctx.stage == ADJUST.name:
            assert self.watcher.cell.truth is not None
            self.truth = self.watcher.cell.truth()
        hand = self.watcher.proof.seated_hand
        if hand is not None and (not self.proofs or self.proofs[-1].seated_hand is not hand):
            self.proofs.append(self.watcher.proof)
        self.curve = self.curve.after(seen, setpoint, self.latch)
        found = self.curve.signature(self.latch, seen.stamp)
        if found is not None:
            self.said, self.shown = found, self.curve


def run_trial(config: CellConfig, kind: str, case: Case, seed: int) -> tuple[SeatingRow, Curves]:
    """Run one insertion on a fresh cell of this seed.

    Without a hole, every stage runs, whatever the result of the one before.
    """
    latch = LATCHES[kind]
    assert config.sim is not None
    hole = config.hole.model_copy(
        update={
            "evidence": "force",
            "latch": latch,
            "area": AREA,
        }
    )
    true = {"latch_wear": case.wear, "shallow": case.shallow, "present": case.has_hole}
    plate = config.sim.plate.model_copy(update=true)
    sim = config.sim.model_copy(update={"seed": seed, "pace": "max", "plate": plate})
    config = config.with_params(SEARCH, timeout=SEARCHED)
    config = config.model_copy(update={"hole": hole, "sim": sim, "retries": 0})
    cell = assemble(config)
    assert cell.truth is not None
    with opened(cell):
        ctx = cell.context(seed)
        recorder = Recorder(Watcher(cell, ctx), latch)
        ctx.record = recorder.record
        records: list[StageRecord] = []
        try:
            records = _performed(case, config, ctx)
            ending = recorder.watcher.judged(ending_of(records, None, ctx.stage), records)
            outcome, reason = ending.outcome, ending.word
        except CellError as error:
            outcome, reason = Outcome.FAILURE, FaultCode(error.code).name.lower()
        truth = recorder.truth or cell.truth()
        look = LastLook(cell.gripper.read(), cell.arm.read().tcp.position, cell.switch.read())
    at_bottom = truth.is_in_hole and truth.depth >= config.hole.depth - ON_BOTTOM
    said, shown = recorder.said, recorder.shown
    row = SeatingRow(
        kind=kind,
        case=case.name,
        seed=seed,
        outcome=outcome,
        reason=reason,
        depth=truth.depth,
        is_seated=case.is_seated and at_bottom,
        is_told=outcome is Outcome.SUCCESS,
        is_believed=any(_is_believed(proof, records, look, ctx) for proof in recorder.proofs),
        force=None if said is None else said.force,
        offset=None if said is None else said.offset,
        doubt=None if said is None else said.doubt,
        hanging=None if said is None else hanging(Way(shown.heights, shown.forces), latch),
        ways=len(shown.ways),
        max_penetration=truth.max_penetration,
        is_void=truth.is_void,
    )
    lowest = shown.heights[-1] if shown.heights else math.nan
    return row, Curves(kind, case.name, seed, tuple(height - lowest for height in shown.heights), shown.forces)


def _performed(case: Case, config: CellConfig, ctx: SkillContext) -> list[StageRecord]:
    skills = config.skill_set()
    if case.has_hole:
        return CATALOGUE["insert_peg"].run(skills, ctx)
    return [record for entry in (GRASP, SEARCH, INSERT, ADJUST) for record in entry.run(skills, ctx)]


def _is_believed(proof: Evidence, records: Sequence[StageRecord], look: LastLook, ctx: SkillContext) -> bool:
    """Return True if the gate accepts a reported success of a seated peg."""
    told, nobody = Ending(Outcome.SUCCESS, ADJUST.name, Reason.NONE), PartState(PartPlace.UNKNOWN, "")
    try:
        judged(Claim.SEATED, told, records, proof, look, nobody, ctx.job)
    except CellError:
        return False
    return True


def hanging(way: Way, latch: Latch) -> float | None:
    """Return the correlation length of a curve's deviations from its best-fit latch, m; None if the curve shows no
    latch.

    It is the integral of their autocorrelation to its first zero, in both directions.
    """
    profile = way.profile(latch)
    if profile is None:
        return None
    above, force = profile
    best = told_by([way], latch)
    rest = force - best.force / latch.force * resistance(above - best.offset, latch)
    rest = rest - rest.mean()
    size = float(np.mean(rest * rest))
    likeness = [float(np.mean(rest[lag:] * rest[: len(rest) - lag])) / size for lag in range(1, len(rest) // 2)]
    return GRID * (1.0 + 2.0 * sum(takewhile(lambda share: share > 0.0, likeness)))


def case_names(asked: Sequence[str]) -> list[str]:
    """Return the names of the requested cases, or of all.

    Raises:
        ConfigError: A case of that name does not exist.
    """
    known = [case.name for case in CASES]
    for name in asked:
        if name not in known:
            raise ConfigError(f"--case {name}: no such case; {', '.join(known)} allowed")
    return list(asked) or known


def measure(
    config: CellConfig,
    kinds: Sequence[str],
    counts: dict[str, int],
    seed: int,
    workers: int,
    done: Callable[[SeatingRow], None],
) -> tuple[list[SeatingRow], list[Curves]]:
    """Run the trials of every kind of latch and every case, and return their rows and curves in order.

    Args:
        config: Config of the cell of every trial, except its hole's evidence and latch.
        kinds: Kinds of latches.
        counts: Number of trials by the name of the case; cases without an entry are omitted.
        seed: Seed of the first trial of each case.
        workers: Number of processes.
        done: Called with the row of each completed trial.
    """
    rows, curves = [], []
    for kind in kinds:
        for case in CASES:
            seeds = range(seed, seed + counts.get(case.name, 0))
            task = partial(run_trial, config, kind, case)
            tried = map(task, seeds) if workers == 1 else on_processes(task, seeds, workers)
            found = []
            for one in tried:
                found.append(one)
                done(one[0])
            found.sort(key=lambda pair: pair[0].seed)
            rows += [row for row, _ in found]
            curves += [curve for _, curve in found]
    return rows, curves


def lines_of(rows: Sequence[SeatingRow]) -> list[SeatingLine]:
    """Return the counts of every case of every kind."""
    lines = []
    for kind, case in dict.fromkeys((row.kind, row.case) for row in rows):
        own = [row for row in rows if (row.kind, row.case) == (kind, case)]
        seated = [row for row in own if row.is_seated]
        missed = sum(not row.is_told for row in seated)
        false = sum((row.is_told or row.is_believed) and not row.is_seated for row in own)
        wrong, of = (missed, len(seated)) if seated else (false, len(own))
        lengths = [row.hanging for row in own if row.hanging is not None]
        length, ways = median(lengths) if lengths else math.nan, fmean(row.ways for row in own)
        lines.append(SeatingLine(kind, case, len(own), len(seated), missed, false, length, ways, *wilson(wrong, of)))
    return lines


@contextmanager
def growing_table(path: Path) -> Iterator[Callable[[SeatingRow], None]]:
    """Yield a function that appends a row to a CSV file at once, so that an interrupted study keeps its rows."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(SeatingRow)], lineterminator="\n")
        writer.writeheader()

        def add(row: SeatingRow) -> None:
            writer.writerow(asdict(row))
            file.flush()

        yield add


def write_table(rows: Sequence[SeatingRow], path: Path) -> None:
    """Write rows as CSV."""
    with growing_table(path) as add:
        for row in rows:
            add(row)
