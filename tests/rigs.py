"""Rigs for the contact gates: a peg at a fixed attitude on three slides above one hole."""

import math

import mujoco
import numpy as np

from drivers.quantities import Vector
from sim import contact, native

HOLE_DEPTH = 0.03


def tilted_peg(
    diameter: float, hole: float, tilt: float, azimuth: float, friction: float, timestep: float
) -> mujoco.MjModel:
    """Return a peg of 0.5 kg whose end's middle is at the slides' origin, leaning by `tilt` towards `azimuth`."""
    contact.install()
    length = 0.05
    axis = lean(tilt, azimuth)
    user = " ".join(map(repr, map(float, contact.plate_user(hole / 2, HOLE_DEPTH, friction, timestep))))
    middle = " ".join(map(repr, map(float, axis * length / 2)))
    along = " ".join(map(repr, map(float, axis)))
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{timestep}" gravity="0 0 0" cone="elliptic" impratio="10" tolerance="1e-14" iterations="60"/>
        <size nuser_geom="{contact.USER}" nuserdata="{native.NUSERDATA}"/>
        <worldbody><geom type="ellipsoid" size="0.1 0.1 0.1" user="{user}"/>
        <body><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="slide" axis="0 0 1"/>
        <geom name="peg" type="cylinder" size="{diameter / 2} {length / 2}" pos="{middle}" zaxis="{along}" mass="0.5"/>
        </body></worldbody></mujoco>"""
    )


def lean(tilt: float, azimuth: float) -> Vector:
    """Return the peg's axis, from its end upward."""
    return np.array([math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), math.cos(tilt)])


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


def section_depth(diameter: float, hole: float, tilt: float) -> float:
    """Return the exact depth by the full section test, independent of the simulation, m.

    The part of the peg below the surface, projected on the surface, must fit inside the hole's disc. Its outline
    is made of the rim below the surface and of where the peg's side leaves the surface.
    """
    r = diameter / 2
    angle = np.linspace(0.0, 2.0 * math.pi, 40001)
    x, y = r * np.cos(angle) * math.cos(tilt), r * np.sin(angle)

    def fits(depth: float) -> bool:
        z = r * math.sin(tilt) - depth - r * np.cos(angle) * math.sin(tilt)
        below = z <= 0.0
        px = np.concatenate([x[below], x[below] - z[below] * math.tan(tilt)])
        py = np.concatenate([y[below], y[below]])
        low, high = -hole, hole
        for _ in range(60):
            third = (high - low) / 3.0
            if np.max((px - low - third) ** 2 + py**2) < np.max((px - high + third) ** 2 + py**2):
                high -= third
            else:
                low += third
        return bool(np.max((px - low) ** 2 + py**2) <= (hole / 2) ** 2)

    low, high = 0.0, HOLE_DEPTH
    for _ in range(40):
        depth = (low + high) / 2.0
        low, high = (depth, high) if fits(depth) else (low, depth)
    return low
