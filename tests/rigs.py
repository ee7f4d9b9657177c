"""Rigs for the contact gates: a peg at a fixed attitude on three slides above one hole."""

import math

import mujoco
import numpy as np

from sim import contact
from sim.rig import HOLE_DEPTH as HOLE_DEPTH
from sim.rig import lean as lean
from sim.rig import tilted_peg as tilted_peg
from sim.section import section_depth as section_depth


def pushed_depth(
    model: mujoco.MjModel, radius: float, tilt: float, azimuth: float, push: float, steps: int
) -> tuple[float, float]:
    """Push the peg down, free to move sideways, from above the hole until it rests.

    Returns:
        Depth of its lowest point below the surface, m, and the deepest penetration in the bore or at its rim, m.
    """
    data = mujoco.MjData(model)
    data.qpos[:2] = -0.3 * radius * math.cos(tilt) * np.array([math.cos(azimuth), math.sin(azimuth)])
    data.qpos[2] = radius * math.sin(tilt) + 1e-4
    for _ in range(steps):
        data.qfrc_applied[:] = np.array([0.0, 0.0, -push]) - 5.0 * data.qvel
        mujoco.mj_step(model, data)
    return float(radius * math.sin(tilt) - data.qpos[2]), float(data.userdata[contact.PENETRATION])
