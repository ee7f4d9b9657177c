"""Holes without a switch: seated parts that the force against depth does not detect, and other parts that it accepts as seated.

Each trial is judged twice: by the cell as usual, and by its success gate as if a skill reported a success in some scan.
"""

import argparse
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile

import numpy as np

from cell.config.load import load
from cell.devices.assembly import Cell
from cell.film.drawing import COLOURS
from cell.lab.arguments import load_simulated, seeds_of
from cell.lab.charts import INK, Curve, Panel, draw_panels
from cell.lab.compare import chosen, compared, section
from cell.lab.report import StudyReport, reported
from cell.lab.rows import average, known, quantile
from cell.lab.tables import Columns, share, table
from cell.lab.trials import Probe, TrialRow
from cell.peg.ending import Ending
from cell.peg.part_state import PartState
from cell.peg.success import LastLook, SeatingProof, evidence_for, judged
from drivers.errors import CellError
from drivers.parts import Latch
from drivers.quantities import ImpedanceSetpoint, Vector
from plc_bridge.protocol.messages import PartPlace
from sim.world.truth import Truth
from skills.catalogue import ADJUST
from skills.contract import Observation, Outcome, Reason, SkillContext
from skills.entry import Claim
from skills.flow import StageRecord
from skills.seating.latch_likelihood import GRID, InsertionStroke, Signature, resistance, told_by
from skills.seating.signature import StrokeCurve as Force

SEATED = "seated"
"""Name of the case in which a part on the bottom is seated; in all other cases the latch is worn out or the bottom is not the stated one."""
SHOWN = 6
"""Largest number of curves of one case in the picture."""


class Seating(Probe):
    """Observes one trial as the success gate does, and stores the result of the last curve of force against height."""

    def __init__(self, cell: Cell, ctx: SkillContext) -> None:
        """Begin with the evidence of the job."""
        assert cell.truth is not None
        assert ctx.job.hole.latch is not None
        super().__init__(cell, ctx)
        self._latch = ctx.job.hole.latch
        self._proof = evidence_for(ctx.job.hole)
        self._curve, self._shown = Force(), Force()
        self._said: Signature | None = None
        self._proofs: list[SeatingProof] = []
        """Evidence at each scan with a seated peg; a skill that reports falsely could have ended at any of these scans."""
        self._truth: Truth = cell.truth()

    def record(self, seen: Observation, setpoint: ImpedanceSetpoint | None) -> None:
        """Add one scan."""
        self._proof = self._proof.after(seen, setpoint)
        if self._ctx.stage == ADJUST.name:
            assert self._cell.truth is not None
            self._truth = self._cell.truth()
        hand = self._proof.seated_hand
        if hand is not None and (not self._proofs or self._proofs[-1].seated_hand is not hand):
            self._proofs.append(self._proof)
        self._curve = self._curve.after(seen, setpoint, self._latch)
        found = self._curve.signature(self._latch, seen.stamp)
        if found is not None:
            self._said, self._shown = found, self._curve

    def columns(self, records: Sequence[StageRecord]) -> dict[str, str]:
        """Return depth, judgements and curve; empty if the peg did not come to rest."""
        cell, said, shown = self._cell, self._said, self._shown
        look = LastLook(cell.gripper.read(), cell.arm.read().tcp.position, cell.switch.read())
        # Largest true distance from the bottom of the end of a seated peg, m.
        is_on_bottom = self._truth.is_in_hole and self._truth.depth >= cell.config.hole.depth - 3e-4
        lowest = shown.heights[-1] if shown.heights else math.nan
        found: dict[str, float | None] = {
            "seated_depth": self._truth.depth,
            "on_bottom": float(is_on_bottom),
            "believed": float(any(_is_believed(proof, records, look, self._ctx) for proof in self._proofs)),
            **dict.fromkeys(("latch_force", "latch_offset", "doubt", "hanging")),
            "ways": float(len(shown.ways)),
        }
        if said is not None:
            length = hanging(InsertionStroke(shown.heights, shown.forces), self._latch)
            found |= {"latch_force": said.force, "latch_offset": said.offset, "doubt": said.doubt, "hanging": length}
        texts = {name: "" if value is None else f"{value:.6g}" for name, value in found.items()}
        heights = " ".join(f"{height - lowest:.6f}" for height in shown.heights)
        return {**texts, "heights": heights, "forces": " ".join(f"{force:.3f}" for force in shown.forces)}


def _is_believed(proof: SeatingProof, records: Sequence[StageRecord], look: LastLook, ctx: SkillContext) -> bool:
    """Return True if the success gate accepts a reported success with this evidence."""
    told, nobody = Ending(Outcome.SUCCESS, ADJUST.name, Reason.NONE), PartState(PartPlace.UNKNOWN, "")
    try:
        judged(Claim.SEATED, told, records, proof, look, nobody, ctx.job)
    except CellError:
        return False
    return True


def hanging(way: InsertionStroke, latch: Latch) -> float | None:
    """Return the correlation length of a curve's deviations from its best-fit latch, m; None if the curve shows no
    latch.

    The correlation length is the integral of the deviations' autocorrelation, in both directions up to the first zero.
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


@dataclass(frozen=True, slots=True)
class SeatingLine:
    """One case."""

    case: str
    trials: int
    seated: int
    """Number of trials with a truly seated part."""
    missed: int
    """Number of truly seated parts that the cell did not report as seated."""
    false: int
    """Number of parts that are not seated but accepted as seated: by the cell, or by its gate after a false report of a skill."""
    least_doubt: float
    """Smallest likelihood share of latches with another force or height, fraction; NaN if there is no curve."""
    hanging: float
    """Median correlation length of the deviations of the last curves, m."""
    ways: float
    """Mean number of insertion strokes."""


def line_of(case: str, rows: Sequence[TrialRow]) -> SeatingLine:
    """Return the counts of one case."""
    on_bottom, believed, doubts, lengths, ways = (
        _column(rows, name) for name in ("on_bottom", "believed", "doubt", "hanging", "ways")
    )
    told = np.array([row.outcome == Outcome.SUCCESS for row in rows], dtype=bool)
    seated = (on_bottom > 0.0) & (case == SEATED)
    return SeatingLine(
        case=case,
        trials=len(rows),
        seated=int(seated.sum()),
        missed=int((seated & ~told).sum()),
        false=int(((told | (believed > 0.0)) & ~seated).sum()),
        least_doubt=quantile(known(doubts), 0.0),
        hanging=quantile(known(lengths), 0.5),
        ways=average(ways),
    )


def _column(rows: Sequence[TrialRow], name: str) -> Vector:
    """Return one column of the probe, shape (n,); NaN for an empty cell."""
    return np.array([float(row.more[name] or "nan") for row in rows])


def panel(cases: Mapping[str, Sequence[TrialRow]]) -> Panel:
    """Return the panel with the curves of the first trials of every case, and the latch that variants.toml states for all cases."""
    curves, latch = [], load(sets=section("seating")["common"]).cell.hole.latch
    assert latch is not None
    for number, (case, rows) in enumerate(reversed(list(cases.items()))):
        shown = [row for row in rows if row.more.get("heights")][:SHOWN]
        for place, row in enumerate(shown):
            x, y = (np.array(row.more[name].split(), dtype=float) for name in ("heights", "forces"))
            colour = COLOURS[-1] if case == SEATED else COLOURS[1 + number]
            curves.append(Curve(1e3 * x, y, colour, "" if place else case, size=1.6 if case == SEATED else 0.8))
    above = np.linspace(0.0, 1.5 * latch.height, 200)
    curves.append(Curve(1e3 * above, resistance(above, latch), INK, "latch as stated", "--"))
    x_label, y_label = "height of the hand above where the peg rests (mm)", "reported force on the hand along z (N)"
    return Panel(f"detent, {latch.force:g} N over {1e3 * latch.height:g} mm", x_label, y_label, curves)


def run(args: argparse.Namespace) -> StudyReport:
    """Run every case, write the tables, draw the picture."""
    load_simulated(args)
    tried = chosen(args.name, args.quick, args.case, "--case")
    found = compared(args, tried, seeds_of(args, section(args.name)["trials"]))
    cases = {line.family: rows for line, rows in zip(found.lines, found.rows, strict=True)}
    lines = [line_of(case, rows) for case, rows in cases.items()]
    title = f"Force against height above the resting place, up to {SHOWN} trials of each case\n{found.title}"
    columns: Columns = {
        "seated": lambda line: f"{line.seated}/{line.trials}",
        "missed": lambda line: share(line.missed, line.seated) if line.seated else "-",
        "false": lambda line: share(line.false, line.trials - line.seated) if line.trials > line.seated else "-",
        "least doubt": lambda line: f"{line.least_doubt:.3g}",
        "ways": lambda line: f"{line.ways:.1f}",
        "hanging (mm)": lambda line: f"{1e3 * line.hanging:.2f}",
    }
    caption = "false: reported as seated, or accepted by the gate if the skill had reported it, and not seated"
    shown = table(found.title, {"case": lambda line: line.case}, columns, lines, caption)
    chart = draw_panels([panel(cases)], title, found.folder / "seating.png")
    return reported(shown, found.folder, {"seating.csv": lines}, [chart], title=found.title, lines=lines)
