"""Off-screen pictures of the scene."""

import os
import sys
from contextlib import ExitStack
from typing import Any, Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from drivers.errors import ConfigError
from drivers.quantities import Vector
from sim.visual.scene import BESIDE, MOST_TRAIL, OPENED, TRAIL, WHOLE, Stage

Image = NDArray[np.uint8]
"""An image, shape (height, width, 3), red first."""
ADVICE = "pictures without a display need EGL and a software driver, on Debian the packages libegl1 and libgl1-mesa-dri"
"""Advice if OpenGL does not work."""
TRAIL_COLOUR = np.array([0.05, 0.55, 0.75, 1.0], dtype=np.float32)


class Camera:
    """Renders the scene off screen; it is a context manager for one thread."""

    def __init__(self, stage: Stage) -> None:
        """Store the scene; `__enter__` creates the OpenGL resources."""
        self._stage, self._open = stage, ExitStack()
        self._scene = mujoco.MjvScene(stage.model, maxgeom=1000 + MOST_TRAIL)
        self._option = mujoco.MjvOption()

    def __enter__(self) -> Self:
        """Get an OpenGL context.

        Raises:
            ConfigError: This computer offers no OpenGL context.
        """
        visual = self._stage.model.vis.global_
        try:
            gl = _context_type()(visual.offwidth, visual.offheight)
            self._open.callback(gl.free)
            gl.make_current()
            self._context = mujoco.MjrContext(self._stage.model, mujoco.mjtFontScale.mjFONTSCALE_150)
            self._open.callback(self._context.free)
        except (ImportError, AttributeError, OSError, RuntimeError, mujoco.FatalError) as error:
            self._open.close()
            raise ConfigError(f"OpenGL: {error or type(error).__name__}; {ADVICE}".replace("\n", " ")) from None
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        return self

    def __exit__(self, *_: object) -> None:
        """Release the OpenGL context."""
        self._open.close()

    def cell(self, width: int, height: int, trail: Vector) -> Image:
        """Return a picture of the whole cell as posed, with the line through `trail`, shape (n, 3), m."""
        return self._shoot("cell", width, height, trail, hidden=(OPENED,))

    def section(self, width: int, height: int) -> Image:
        """Return a picture of the hole cut open, seen along y of the base frame."""
        return self._shoot("section", width, height, np.empty((0, 3)), hidden=(WHOLE, BESIDE))

    def _shoot(self, camera: str, width: int, height: int, trail: Vector, hidden: tuple[int, ...]) -> Image:
        model, data, scene = self._stage.model, self._stage.data, self._scene
        self._option.geomgroup[:] = 1
        for group in hidden:
            self._option.geomgroup[group] = 0
        view = mujoco.MjvCamera()
        view.type, view.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, model.camera(camera).id
        mujoco.mjv_updateScene(
            model, data, self._option, mujoco.MjvPerturb(), view, mujoco.mjtCatBit.mjCAT_ALL.value, scene
        )
        scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = camera == "cell" and self._stage.is_fine
        draw_trail(scene, trail)
        box = mujoco.MjrRect(0, 0, width, height)
        mujoco.mjr_render(box, scene, self._context)
        image = np.empty((height, width, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(image, None, box, self._context)
        return np.ascontiguousarray(image[::-1])


def draw_trail(scene: mujoco.MjvScene, trail: Vector) -> None:
    """Add the line through `trail`, shape (n, 3), m, to a scene; a NaN point interrupts it."""
    known = np.flatnonzero(np.isfinite(trail).all(axis=1))
    for first in known[:-1][np.diff(known) == 1][: scene.maxgeom - scene.ngeom]:
        start, end = trail[first : first + 2]
        geom = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_LINE, np.zeros(3), np.zeros(3), np.eye(3).ravel(), TRAIL_COLOUR)
        mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_LINE, TRAIL, start, end)
        scene.ngeom += 1


def _context_type() -> Any:
    """Return the class of the OpenGL context: the one named by MUJOCO_GL, or EGL on Linux, which needs no display."""
    if sys.platform == "linux" and not os.environ.get("MUJOCO_GL"):
        from mujoco.egl import GLContext
    else:
        from mujoco.rendering.classic.gl_context import GLContext
    return GLContext
