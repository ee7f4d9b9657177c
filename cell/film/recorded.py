"""A recorded run for pictures: the poses of all bodies at each scan."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cell.records.journal import Journal
from cell.records.samples import read_facts, read_samples
from cell.records.schema import RunRow
from drivers import frames
from drivers.arm.kinematics import finger_frame
from drivers.errors import JournalError
from drivers.quantities import FINGERS, Pose, Vector
from drivers.scene_facts import SceneFacts
from sim.visual.scene import Moment
from skills.catalogue import CATALOGUE

TRAIL_STEP, TRAIL_HEIGHT = 5, 0.006
"""Number of scans between two points of the tip's drawn path, and the largest drawn height above the hole, m."""


@dataclass(frozen=True)
class RecordedRun:
    """One run: its row in the journal, the facts of its scene, its samples."""

    row: RunRow
    facts: SceneFacts
    samples: dict[str, Vector]

    @cached_property
    def times(self) -> Vector:
        """Time of each scan since the first, s."""
        times: Vector = self.samples["stamp"] - self.samples["stamp"][0]
        return times

    @cached_property
    def stages(self) -> list[str]:
        """Name of each scan's stage; empty between stages."""
        return [CATALOGUE.stages.get(int(number), "") for number in self.samples["stage"]]

    @cached_property
    def force(self) -> Vector:
        """Magnitude of each scan's external force, N."""
        force = np.column_stack([self.samples[f"force_{axis}"] for axis in "xyz"])
        size: Vector = np.linalg.norm(force, axis=1)
        return size

    @property
    def is_simulated(self) -> bool:
        """True if the samples hold the true poses of peg and hole."""
        return bool(np.isfinite(self.samples["true_peg_x"]).any())

    def hole(self) -> Pose | None:
        """Return the pose of the hole: the true one if simulated, else the tip's when the switch first closed; None if it never did."""
        if self.is_simulated:
            return self._true("hole", 0)
        closed = np.flatnonzero(self.samples["switch"] == 1.0)
        if not closed.size:
            return None
        x, y, _ = self._vector("tip", int(closed[0]))
        return Pose(np.array([x, y, self.facts.job.hole.centre[2]]), np.eye(3))

    def at(self, time: float) -> int:
        """Return the number of the last scan at or before `time`, s."""
        return max(int(np.searchsorted(self.times, time, side="right")) - 1, 0)

    def moment(self, scan: int) -> Moment:
        """Return the visible state of the cell at one scan."""
        samples = self.samples
        return Moment(
            joints=samples["joints"][scan],
            width=float(samples["width"][scan]),
            peg=self._peg(scan),
            taxels=samples["taxels"][scan].reshape(FINGERS, -1),
            is_seated=bool(samples["switch"][scan] == 1.0),
        )

    def trail(self, scan: int) -> Vector:
        """Return the path of the tip until a scan, shape (n, 3), m; NaN for points above `TRAIL_HEIGHT` or outside the counted stages."""
        line = np.column_stack([self.samples[f"tip_{axis}"][: scan + 1 : TRAIL_STEP] for axis in "xyz"])
        hole = self.hole()
        surface = self.facts.job.hole.centre[2] if hole is None else float(hole.position[2])
        works = [stage in CATALOGUE.counted for stage in self.stages[: scan + 1 : TRAIL_STEP]]
        line[(line[:, 2] > surface + TRAIL_HEIGHT) | ~np.array(works)] = np.nan
        # The line is drawn 0.6 mm above the plate, which would hide it otherwise.
        line[:, 2] = np.maximum(line[:, 2], surface) + 0.0006
        return line

    def theta(self, scan: int) -> float:
        """Return the estimated in-hand angle at one scan, rad; NaN if the hand is too wide open to hold a peg."""
        if float(self.samples["width"][scan]) > self.facts.widest:
            return math.nan
        return float(self.samples["theta"][scan])

    def _peg(self, scan: int) -> Pose | None:
        if self.is_simulated:
            return self._true("peg", scan)
        peg, theta = self.facts.job.peg, self.theta(scan)
        if math.isnan(theta):
            return None
        held = frames.peg_in_finger(theta, peg.length)
        end = frames.compose(finger_frame(self.facts.arm, self.samples["joints"][scan]), held)
        return Pose(end.position + (peg.length + peg.overhang) / 2 * end.rotation[:, 2], end.rotation)

    def _true(self, what: str, scan: int) -> Pose:
        turned = np.array([self.samples[f"true_{what}_q{part}"][scan] for part in "wxyz"])
        return Pose(self._vector(f"true_{what}", scan), frames.rotation_of(turned))

    def _vector(self, name: str, scan: int) -> Vector:
        return np.array([self.samples[f"{name}_{axis}"][scan] for axis in "xyz"])


def recorded(journal: Journal, number: int) -> RecordedRun:
    """Return a recorded run.

    Raises:
        JournalError: The run is not on record, has no samples, or lacks the facts that a picture needs.
    """
    row = journal.find(number)
    path = journal.samples_path(number)
    run = RecordedRun(row, read_facts(path), read_samples(path))
    if not run.samples["stamp"].size:
        raise JournalError(f"{path}: no samples on record; choose a run in which the arm moved")
    return run
