"""Facts that a picture of a run needs beside the run's samples: the arm, the part and its places, the skin's layout.

The head of a run's samples stores the facts, so that a run can be drawn after its config has changed.
"""

from dataclasses import dataclass

from drivers.arm.model import ArmModel
from drivers.config_model import ConfigModel
from drivers.parts import Job
from drivers.quantities import Pose
from drivers.skin.layout import Layout


class SceneFacts(ConfigModel):
    """The scene of one run."""

    arm: ArmModel
    job: Job
    layout: Layout


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """The true poses of peg and hole, base frame; available in a simulated cell only."""

    peg: Pose
    """Pose of the peg's middle, z from its end upward."""
    hole: Pose
    """Pose of the hole's mouth, z out of the plate."""
