"""Hands with fewer frames, or with a theta that replaces the measured one: 0, frozen, biased or exact.

The functions are programs of a study's trials, or parts of them. No skill can reach anything in this module.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from cell.devices.assembly import Cell, make_tracker
from cell.lab.trials import Program, insert_peg
from drivers.quantities import TaxelFrame
from sim.boards.faulty import FaultyDevice
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


def _give(cell: Cell, ctx: SkillContext, given: Callable[[PegPose], PegPose]) -> None:
    """Replace the measured pose of a held peg by the result of `given`, for the rest of the trial."""
    ctx.perception = replace(ctx.perception, tracker=Given(make_tracker(cell.config), given))


def take_for_straight(cell: Cell, ctx: SkillContext) -> None:
    """Replace theta and the offset of a held peg by 0."""
    _give(cell, ctx, lambda measured: replace(measured, theta=0.0, offset=0.0))


def insert_with_frozen_theta(cell: Cell, ctx: SkillContext) -> list[StageRecord]:
    """Run the cell's own program with theta frozen at the end of the grasp."""
    held: list[PegPose] = []

    def given(measured: PegPose) -> PegPose:
        if ctx.stage == GRASP.name or not held:
            held[:] = [measured]
        return replace(held[0], stamp=measured.stamp)

    _give(cell, ctx, given)
    return insert_peg(cell, ctx)


def insert_with_exact_theta(cell: Cell, ctx: SkillContext) -> list[StageRecord]:
    """Run the cell's own program with the true theta; no estimator can be better."""
    pivot = cell.pivot
    assert pivot is not None

    def given(measured: PegPose) -> PegPose:
        theta, _ = pivot()
        return measured if math.isnan(theta) else replace(measured, theta=theta)

    _give(cell, ctx, given)
    return insert_peg(cell, ctx)


def with_biased_theta(program: Program, bias: float, cell: Cell, ctx: SkillContext) -> list[StageRecord]:
    """Run a program with a constant error `bias`, rad, added to the measured theta."""
    _give(cell, ctx, lambda measured: replace(measured, theta=measured.theta + bias))
    return program(cell, ctx)


def with_lost_frames(program: Program, arriving: float, cell: Cell, ctx: SkillContext) -> list[StageRecord]:
    """Run a program whose skin delivers only the share `arriving` of its frames, drawn from the trial's seed.

    If a frame is lost, a read returns the last frame that arrived.
    """
    rng = np.random.default_rng([cell.config.first_seed, 7])
    newest, shown = -math.inf, list[TaxelFrame]()

    def arrived(frame: TaxelFrame) -> TaxelFrame:
        nonlocal newest
        if frame.stamp > newest:
            newest = frame.stamp
            if not shown or rng.uniform() < arriving:
                shown[:] = [frame]
        return shown[0]

    ctx.devices = replace(ctx.devices, skin=FaultyDevice(ctx.devices.skin, arrived))
    return program(cell, ctx)
