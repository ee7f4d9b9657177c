"""What a picture of a run has to know beside its samples: the arm, the part and its places, the skin's layout.

The facts are written into the head of a run's samples, so that a run can be drawn long after its config has changed.
"""

from dataclasses import dataclass

from drivers.arm.model import ArmModel
from drivers.config_model import ConfigModel
from drivers.parts import Job
from drivers.quantities import Pose
from drivers.skin.layout import Layout


class SceneFacts(ConfigModel):
    """What the scene of one run is made of."""

    arm: ArmModel
    job: Job
    layout: Layout


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """Where peg and hole really are, base frame; only a simulated cell knows."""

    peg: Pose
    """Pose of the peg's middle, z from its end upward."""
    hole: Pose
    """Pose of the hole's mouth, z out of the plate."""
