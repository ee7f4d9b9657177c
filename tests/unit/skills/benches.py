"""A skill over a scripted hand: the bench of every skill that holds the peg in contact."""

from collections.abc import Callable, Iterator
from typing import Any

from drivers.quantities import ImpedanceSetpoint, Pose
from skills.contract import Observation, SkillParams
from skills.search.surface import Plane
from tests.fakes import Rig
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

    def turn(self, time: float, theta: float) -> None:
        """Let the skin measure another in-hand angle, rad, from a time on, s."""
        self.rig.clock.at.append((time - 1e-9, lambda: setattr(self.skin, "theta", theta)))
