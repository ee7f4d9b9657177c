"""Hands that do not measure theta: it is taken for 0, frozen after the grasp, or known exactly from the stand-in.

Each function is a program of a study's trials. Nothing of this can be reached from a skill.
"""

import math
from collections.abc import Callable
from dataclasses import replace

from cell.devices.assembly import Cell, make_tracker
from cell.lab.trials import insert_peg
from skills.catalogue import GRASP
from skills.contract import SkillContext
from skills.flow import StageRecord
from skills.tactile.pose import PegPose, Tracker


class Given:
    """Tracks the frames, and replaces the measured pose of a held peg."""

    def __init__(self, measured: Tracker, given: Callable[[PegPose], PegPose]) -> None:
        """Begin without an estimate."""
        self._measured, self._given = measured, given

    def follow(self, new: PegPose | None, stamp: float, moment: float) -> PegPose:
        """Return the present pose of the peg; see `Tracker`."""
        measured = self._measured.follow(new, stamp, moment)
        return self._given(measured) if measured.healthy else measured


def take_for_straight(cell: Cell, ctx: SkillContext) -> None:
    """Let the hand take theta for 0."""
    ctx.perception = replace(
        ctx.perception,
        tracker=Given(make_tracker(cell.config), lambda measured: replace(measured, theta=0.0, offset=0.0)),
    )


def insert_with_frozen_theta(cell: Cell, ctx: SkillContext) -> list[StageRecord]:
    """Run the cell's own program with theta frozen at the end of the grasp."""
    held: list[PegPose] = []

    def given(measured: PegPose) -> PegPose:
        if ctx.stage == GRASP.name or not held:
            held[:] = [measured]
        return replace(held[0], stamp=measured.stamp)

    ctx.perception = replace(ctx.perception, tracker=Given(make_tracker(cell.config), given))
    return insert_peg(cell, ctx)


def insert_with_exact_theta(cell: Cell, ctx: SkillContext) -> list[StageRecord]:
    """Run the cell's own program with the true theta, the bound for every estimator."""
    pivot = cell.pivot
    assert pivot is not None

    def given(measured: PegPose) -> PegPose:
        theta, _ = pivot()
        return measured if math.isnan(theta) else replace(measured, theta=theta)

    ctx.perception = replace(ctx.perception, tracker=Given(make_tracker(cell.config), given))
    return insert_peg(cell, ctx)
