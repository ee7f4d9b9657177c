"""A skill over a hand that is where the test puts it at each time, with a skin that reports scripted poses: to test the setpoints of a skill at each scan."""

from collections.abc import Callable

import numpy as np
import pytest

from cell.config.load import load
from drivers.frames import UP, rotation_about
from drivers.quantities import ImpedanceSetpoint, Pose, Vector
from skills.contract import Callbacks, Interrupted, Observation, Perception, Reason
from skills.tactile.blend import Blend, Smoothing
from tests.fakes import HAND_DOWN, Rig, ToldEstimator

CELL = load().cell
LIGHT = "insert.estimator=image"
"""Setting with which a rig is made at once: the skin reports scripted poses, and its own estimator is not used."""
SQUARE = load(sets=["peg.shape=square", LIGHT])
"""The cell with a square peg."""
HOLE = np.array(CELL.hole.centre)
SIDE = np.array([1.0, 0.0, 0.0])


def hand(tip: Vector = HOLE, tilt: float = 0.0, about: Vector = SIDE) -> Pose:
    """Return the hand whose straight peg has its tip there, m, and leans by `tilt`, rad, about an axis."""
    rotation = rotation_about(about, tilt) @ HAND_DOWN
    return Pose(tip - CELL.peg.length * rotation[:, 0], rotation)


def corner_hand(
    tip: Vector,
    tilt: float,
    direction: float = 0.0,
    yaw: float = 0.0,
    theta: float = 0.0,
    is_turned_round: bool = False,
) -> Pose:
    """Return the hand whose square peg has its tip there, m, and leans by `tilt`, rad, over its corner, at `theta` in the hand, rad.

    The hand closes along the azimuth `direction`, and the corner lies an eighth of a turn further; `yaw` turns both, rad.
    """
    axis, closing = SQUARE.cell.peg.part.leaning(direction, tilt)
    closing = -closing if is_turned_round else closing
    straight = np.column_stack([-axis, np.cross(closing, -axis), closing])
    turned = rotation_about(UP, yaw)
    return Pose(tip + SQUARE.cell.peg.length * turned @ axis, turned @ rotation_about(closing, -theta) @ straight)


class Watched:
    """A hand that holds a peg, with a skin that reports scripted poses, and what a skill saw and commanded."""

    def __init__(self, rig: Rig) -> None:
        self.rig, self.skin, self.ctx = rig, ToldEstimator(), rig.cell.context(1)
        self.seen: list[Observation] = []
        self.commanded: list[ImpedanceSetpoint] = []
        self.progress: list[float] = []
        rig.gripper.grip(30.0)
        self.ctx.perception = Perception(self.skin, Blend(Smoothing(jump=3.0)))
        self.ctx.callbacks = Callbacks(progress=self.progress.append, record=lambda seen, held: self.seen.append(seen))
        self._follow, rig.arm.follow = rig.arm.follow, self._followed

    def turn(self, time: float, theta: float) -> None:
        """Let the skin measure another in-hand angle, rad, from a time on, s."""
        self.rig.clock.at.append((time - 1e-9, lambda: setattr(self.skin, "theta", theta)))

    def lost_in(self, skill: Callable[[], object], after: float = 0.1) -> Reason:
        """Let the hand lose its peg some time, s, after a skill begins; return why that was interrupted, with the arm halted."""
        self.rig.at(after, lambda: self.rig.gripper.release(0.04))
        with pytest.raises(Interrupted) as ended:
            skill()
        assert self.rig.arm.is_halted
        return ended.value.reason

    def _followed(self, setpoint: ImpedanceSetpoint) -> None:
        self.commanded.append(setpoint)
        self._follow(setpoint)


class ScriptedHand(Watched):
    """A hand that is where `way` says at each time, s."""

    def __init__(self, rig: Rig, way: Callable[[float], Pose]) -> None:
        super().__init__(rig)
        self.way = way
        rig.arm.is_blocked = True
        rig.clock.every.append(self.move)

    def move(self) -> None:
        """Put the hand where it is now."""
        self.rig.arm.tcp = self.way(self.rig.clock.now())
