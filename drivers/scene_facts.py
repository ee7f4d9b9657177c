"""Facts that a picture of a run needs beside the run's samples: the arm, the part and its places, the skin's layout; colours of touch.

The head of a run's samples stores the facts, so that a run can be drawn after its config has changed.
"""

from dataclasses import dataclass

import numpy as np

from drivers.arm.model import ArmModel
from drivers.config_model import ConfigModel
from drivers.parts import Job
from drivers.quantities import Pose, Vector
from drivers.skin.layout import LAYOUTS, Layout

_SKIN = LAYOUTS["parallelogram"]
BRIGHT = 0.75 * _SKIN.full_scale
"""Reading of a taxel under high pressure, counts; every picture shows it in the brightest colour."""
NOISE = 3.0 * _SKIN.noise * _SKIN.full_scale
"""Reading below which every picture shows no touch, counts: three standard deviations of the noise that the estimate of theta assumes."""
PALETTE = (
    (0, 0, 4),
    (31, 12, 72),
    (85, 15, 109),
    (136, 34, 106),
    (186, 54, 85),
    (227, 89, 51),
    (249, 140, 10),
    (249, 201, 50),
    (252, 255, 164),
)
"""Colours of touch at equal steps from no touch to `BRIGHT`, each as red, green, blue from 0 to 255."""


class SceneFacts(ConfigModel):
    """The scene of one run."""

    arm: ArmModel
    job: Job
    layout: Layout

    @property
    def widest(self) -> float:
        """Largest opening of the hand that is drawn with the peg in it, m."""
        # If the hand's opening is below this multiple of the peg's thickness, the hand is drawn with the peg.
        return 1.3 * self.job.peg.part.thickness


def felt(counts: Vector) -> Vector:
    """Return readings as pictures draw them: 0 below `NOISE`."""
    return np.where(counts < NOISE, 0.0, counts)


def touch_colours(counts: Vector) -> Vector:
    """Return the colours of readings, red, green, blue from 0 to 255, shape (..., 3)."""
    share = counts / BRIGHT * (len(PALETTE) - 1)
    return np.stack([np.interp(share, range(len(PALETTE)), channel) for channel in zip(*PALETTE, strict=True)], axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """The true poses of peg and hole, base frame; available in a simulated cell only."""

    peg: Pose
    """Pose of the peg's middle, z from its end upward."""
    hole: Pose
    """Pose of the hole's mouth, z out of the plate."""
