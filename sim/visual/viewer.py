"""The scene in MuJoCo's viewer; it needs a display."""

import os
import sys
import warnings
from contextlib import ExitStack
from typing import Any, Self

import numpy as np

from drivers.errors import ConfigError
from drivers.quantities import Pose, Vector
from drivers.scene_facts import SceneFacts
from sim.visual.render import draw_trail
from sim.visual.scene import BESIDE, LOOKS_AT, OPENED, WHOLE, Moment, Stage

DISTANCE, AZIMUTH, ELEVATION = 1.35, 116.0, -16.0
"""Initial position of the camera relative to its target: distance, m, azimuth and elevation, degrees."""


class Window:
    """A window on the scene; it is a context manager."""

    def __init__(self, facts: SceneFacts, hole: Pose | None) -> None:
        """Store the facts of the scene; `__enter__` opens the window."""
        self._facts, self._hole = facts, hole
        self._open = ExitStack()
        self._viewer: Any = None

    def __enter__(self) -> Self:
        """Open the window.

        Raises:
            ConfigError: There is no display.
        """
        _require_display()
        import mujoco.viewer

        self._stage = Stage(self._facts, self._hole)
        self._viewer = self._open.enter_context(
            mujoco.viewer.launch_passive(self._stage.model, self._stage.data, show_left_ui=False, show_right_ui=False)
        )
        with self._viewer.lock():
            self._viewer.opt.geomgroup[[WHOLE, BESIDE]] = 1
            self._viewer.opt.geomgroup[OPENED] = 0
            self._viewer.cam.lookat[:] = LOOKS_AT
            self._viewer.cam.distance, self._viewer.cam.azimuth, self._viewer.cam.elevation = (
                DISTANCE,
                AZIMUTH,
                ELEVATION,
            )
        return self

    def __exit__(self, *_: object) -> None:
        """Close the window."""
        self._open.close()

    def is_open(self) -> bool:
        """True while the window is open."""
        return bool(self._viewer.is_running())

    def show(self, moment: Moment, trail: Vector) -> None:
        """Show the cell at one instant, with the tip's line, shape (n, 3), m."""
        with self._viewer.lock():
            self._stage.pose(moment)
            scene = self._viewer.user_scn
            scene.ngeom = 0
            draw_trail(scene, trail[-np.int64(scene.maxgeom) :])
        self._viewer.sync()


def _require_display() -> None:
    """Check that a window can be opened; without this check, GLFW would report the failure only after a thread has failed.

    Raises:
        ConfigError: No window can be opened.
    """
    import glfw

    is_named = sys.platform != "linux" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    with warnings.catch_warnings(action="ignore"):
        is_there = bool(is_named) and glfw.init()
    if not is_there:
        raise ConfigError("view: needs a display, and none can be opened here; `cell film` needs none")
    glfw.terminate()
