"""What a picture of a run has to know beside its samples: the arm's chain, the part and its places, the skin's layout.

The facts are written into the head of a run's samples, so that a run can be drawn long after its config has changed.
"""

from dataclasses import dataclass

from drivers.config_model import ConfigModel
from drivers.parts import Job
from drivers.quantities import Pose
from drivers.skin.layout import Layout


class Chain(ConfigModel):
    """Geometry of an arm with a parallel hand, modified Denavit-Hartenberg figures (Craig's convention)."""

    a: tuple[float, ...]
    """Length of the link before each joint, m."""
    d: tuple[float, ...]
    """Offset along each joint's axis, m."""
    alpha: tuple[float, ...]
    """Twist of the link before each joint, rad."""
    flange: float
    """Distance from the frame of the last joint to the flange, along z, m."""
    hand_turn: float
    """Rotation of the hand about the flange's z, rad."""
    finger_centre: float
    """Distance from the flange to the middle between the pads, along z, m."""
    stroke: float
    """Largest distance between the pads, m."""


class SceneFacts(ConfigModel):
    """What the scene of one run is made of."""

    arm: Chain
    job: Job
    layout: Layout


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """Where peg and hole really are, base frame; only a simulated cell knows."""

    peg: Pose
    """Pose of the peg's middle, z from its end upward."""
    hole: Pose
    """Pose of the hole's mouth, z out of the plate."""
