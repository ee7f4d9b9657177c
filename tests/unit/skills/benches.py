"""Shared by the tests of skills: a skill over a scripted hand, and an arm and a hand that keep their commands."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from cell.config.cell_config import CellConfig
from drivers.frames import UP
from drivers.quantities import ImpedanceSetpoint, Pose, Vector
from skills.contract import Observation, SkillContext, SkillParams
from skills.search.surface import Plane
from tests.fakes import FakeArm, FakeClock, FakeGripper, Rig, context_of
from tests.scripted import ScriptedHand


class SkillBench(ScriptedHand):
    """A skill over a hand that is where the test puts it at each time."""

    def __init__(self, rig: Rig, skill: Callable[..., Any], params: SkillParams, way: Callable[[float], Pose]) -> None:
        super().__init__(rig, way)
        self.skill, self.params = skill, params

    def run(self, plane: Plane | None = None, timeout: float = 0.5, **changes: object) -> Any:
        """Run the skill with these parameters beside the shipped ones."""
        self.move()
        return self.skill(self.params.model_copy(update={"timeout": timeout, **changes}), self.ctx, plane)

    def scans(self) -> Iterator[tuple[Observation, ImpedanceSetpoint]]:
        """Return each observation with the setpoint that followed on it."""
        return zip(self.seen, self.commanded, strict=True)


def corner_axes(closing: Vector, corner: Vector) -> tuple[Vector, Vector]:
    """Return the closing axis and the one across it, in the plane, each towards the corner over which the peg leans."""
    along = closing * [1.0, 1.0, 0.0] / np.linalg.norm(closing[:2])
    across = np.cross(UP, along)
    return along * np.sign(along @ corner), across * np.sign(across @ corner)


class WatchedArm(FakeArm):
    """An arm that keeps its setpoints, each with its time, s."""

    def __init__(self, clock: FakeClock) -> None:
        super().__init__(clock)
        self.told: list[tuple[float, ImpedanceSetpoint]] = []

    def follow(self, setpoint: ImpedanceSetpoint) -> None:
        super().follow(setpoint)
        self.told.append((self.clock.now(), setpoint))


class WatchedHand(FakeGripper):
    """A hand that keeps each command, with the place of the arm, m; `opens` is False if its fingers stay."""

    def __init__(self, width: float, arm: FakeArm) -> None:
        super().__init__(width)
        self.arm, self.opens = arm, True
        self.closed: list[tuple[float, Vector]] = []
        self.opened: list[tuple[float, Vector]] = []

    def grip(self, force: float) -> None:
        self.closed.append((force, self.arm.tcp.position))
        super().grip(force)

    def release(self, width: float) -> None:
        self.opened.append((width, self.arm.tcp.position))
        if self.opens:
            super().release(width)


def watched(
    config: CellConfig, tcp: Pose | None = None, grip: float = 30.0, make: type[WatchedArm] = WatchedArm
) -> SkillContext:
    """Return the context of a cell whose arm and hand are watched; the hand holds a peg if it grips, N."""
    arm = make(FakeClock())
    arm.tcp = tcp or arm.tcp
    hand = WatchedHand(config.peg.part.thickness, arm)
    if grip:
        hand.grip(grip)
    return context_of(config, arm, hand)
