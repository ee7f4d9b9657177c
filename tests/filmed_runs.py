"""Runs on record for the tests of films, and whether this computer can render."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from cell.film.recorded import RecordedRun
from cell.records.journal import Journal
from cell.records.sample_blocks import SampleStream
from cell.records.schema import RunRow
from cell.run.record import scene_facts
from drivers.arm.kinematics import finger_frame
from drivers.errors import ConfigError
from drivers.frames import UP, compose, peg_in_finger
from drivers.quantities import InHandTip, Pose, SwitchState
from drivers.scene_facts import Sight
from sim.visual.render import Camera
from sim.visual.scene import Stage

ROW = RunRow(0, "2025-01-01T00:00:00.000+00:00", "insert_peg", 1, "A-17", "10.0.0.5:4711", 42)
HOLE = Pose(np.array([0.50, 0.01, 0.10]), np.eye(3))
PERIOD = 0.01


def require_rendering(run: RecordedRun) -> None:
    """Skip the test, with the reason, if this computer has no OpenGL."""
    try:
        with Camera(Stage(run.facts, None)):
            pass
    except ConfigError as error:
        pytest.skip(str(error))


def scan(rig, number: int, width: float, theta: float, is_closed: bool):
    """Return what the cell of fakes sees at one scan, with these readings in it."""
    seen = rig.cell.context(0).observe()
    arm = replace(seen.arm, q=np.array(rig.loaded.cell.arm_model().home), stamp=number * PERIOD)
    return replace(
        seen,
        stamp=number * PERIOD,
        arm=arm,
        gripper=replace(seen.gripper, width=width),
        peg=replace(seen.peg, theta=theta, stamp=number * PERIOD),
        switch=SwitchState.CLOSED if is_closed else SwitchState.OPEN,
    )


def held_peg(rig, theta: float) -> Pose:
    """Return the pose of the middle of a peg held at this angle by the arm at home."""
    config = rig.loaded.cell
    held = InHandTip(theta, config.peg.length)
    end = compose(
        finger_frame(config.arm_model(), np.array(config.arm_model().home)), peg_in_finger(theta, held.length)
    )
    return Pose(end.position + (config.peg.length + config.peg.overhang) / 2 * end.rotation[:, 2], end.rotation)


def record(rig, journal: Journal, *, knows_truth: bool, scans: int = 60) -> int:
    """Put a run on record in which the hand closes on a peg in the middle and the switch at the end; return its number."""
    row = journal.writer.begin(ROW, scene_facts(rig.loaded.cell))
    stream = SampleStream(partial(journal.writer.write, row.run))
    peg = rig.loaded.cell.peg
    upright = Pose(HOLE.position + ((peg.length + peg.overhang) / 2 - 0.012) * UP, np.eye(3))
    for number in range(scans):
        is_held = number >= scans // 2
        seen = scan(
            rig, number, peg.diameter if is_held else 0.04, 0.2 if is_held else math.nan, is_closed=number == scans - 1
        )
        stream.add(seen, None, 2, Sight(upright, HOLE) if knows_truth else None)
    journal.writer.finish(row, (), stream.rest())
    return row.run
