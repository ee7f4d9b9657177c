"""The calibration of one arm, friction and residual gravity torque of each joint: file, checks and prior of learning."""

from datetime import date
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from drivers.arm.learning import DRY_RATE, FIGURES, MOST_OFFSET, SMOOTH_RATE, doubts
from drivers.arm.model import JOINTS, ArmModel, Friction, PerJoint
from drivers.config_model import ConfigModel
from drivers.errors import ConfigError
from drivers.figures_file import read_figures, write_whole
from drivers.quantities import Vector

Speed = Annotated[float, Field(gt=0.0, le=3.0)]
Offset = Annotated[float, Field(ge=-50.0, le=50.0)]

MOST_UNSURE = 0.3
"""Largest half width of the interval of a friction or an offset, N·m. If it is exceeded, the measurement was disturbed."""


class Measured(ConfigModel):
    """One figure of each joint, with half the width of its 95 % interval; N·m."""

    value: PerJoint[Offset]
    interval: PerJoint[Friction]

    def deviation(self) -> Vector:
        """Return the standard deviation of each joint's figure, shape (7,), N·m."""
        return np.array(self.interval) / 1.96


class ArmCalibration(ConfigModel):
    """Calibration of one arm."""

    date: date
    arm: str
    """Name of the arm's model."""
    unit: str
    """Name of the measured arm, as in `CellConfig.arm_unit`."""
    speeds: Annotated[tuple[Speed, ...], Field(min_length=2)]
    """Speeds at which each joint was moved, rad/s."""
    friction: tuple[Measured, ...]
    """Friction of each joint at each of `speeds`: half the difference between the torques in both directions."""
    offset: Measured
    """Mean of the torques in both directions: the residual of the gravity compensation and the asymmetry of friction."""
    dry: Measured
    """Level of the dry friction, fitted to the measured frictions."""
    smooth: Measured
    """Level of the velocity-dependent friction, fitted together with the dry friction."""
    unexplained: PerJoint[Friction]
    """Root mean square of the torque that these figures leave unexplained while all joints move together, N·m."""

    def believed(self, arm: ArmModel) -> tuple[Vector, Vector]:
        """Return the figures that learning begins with, and their standard deviations, each shape (7, 4); see `drivers.arm.learning`.

        The standard deviations exceed the measured ones, because friction changes from day to day and gravity with the posture.
        They never exceed those of an uncalibrated arm. The calibration leaves the rotor inertias to learning.
        """
        changed = 0.2  # Standard deviation of a joint's friction from day to day, fraction: grease warms up; assumed.
        likely, figures = doubts(arm), np.zeros((JOINTS, FIGURES))
        figures[:, 0], figures[:, 1], figures[:, 2] = self.dry.value, self.smooth.value, self.offset.value
        # Change of an arm's likely offset in another posture, fraction; assumed, because only one posture is calibrated.
        may_change = np.column_stack([changed * figures[:, 0], changed * figures[:, 1], 0.3 * likely[:, 2]])
        measured = np.column_stack([figure.deviation() for figure in (self.dry, self.smooth, self.offset)])
        deviations = likely.copy()
        deviations[:, :3] = np.minimum(np.hypot(measured, may_change), likely[:, :3])
        return figures, deviations

    def predicted(self, dq: Vector) -> Vector:
        """Return the joint torques, shape (..., 7), N·m, predicted at the joint velocities `dq`, shape (..., 7), rad/s."""
        friction = np.array(self.dry.value) * np.tanh(dq / DRY_RATE)
        total: Vector = friction + np.array(self.smooth.value) * np.tanh(dq / SMOOTH_RATE) + np.array(self.offset.value)
        return total

    def write(self, path: Path) -> None:
        """Write the whole file, or leave the old one unchanged.

        Raises:
            ConfigError: The file cannot be written; a previous file stays.
        """
        rows = [f'date = {self.date.isoformat()}\narm = "{self.arm}"\nunit = "{self.unit}"']
        rows.append(f"speeds = {_figures(self.speeds)}\nunexplained = {_figures(self.unexplained)}")
        tables = [("offset", self.offset), ("dry", self.dry), ("smooth", self.smooth)]
        rows += [f"\n[{name}]\n{_table(figure)}" for name, figure in tables]
        rows += [
            f"\n# At {v:g} rad/s.\n[[friction]]\n{_table(f)}" for v, f in zip(self.speeds, self.friction, strict=True)
        ]
        head = "# Measured by `cell calibrate arm`; N·m by joint, each with half the width of its 95 % interval; speeds in rad/s.\n"
        write_whole(path, head + "\n".join(rows) + "\n", "calibration")


def read_arm_calibration(path: Path, arm: ArmModel, unit: str) -> ArmCalibration:
    """Return the calibration in a file of `ArmCalibration.write`.

    Raises:
        ConfigError: The file is missing, has another form, belongs to another arm, or holds implausible figures.
    """
    found = read_figures(path, ArmCalibration, "calibration")
    if (found.arm, found.unit) != (arm.name, unit):
        raise ConfigError(f"{path}: of another arm, {found.arm} ({found.unit}); one of {arm.name} ({unit}) allowed")
    if len(found.friction) != len(found.speeds):
        raise ConfigError(
            f"{path}: friction: {len(found.friction)} tables; one for each of {len(found.speeds)} speeds allowed"
        )
    if (why := implausible(found, arm)) is not None:
        raise ConfigError(f"{path}: {why}")
    return found


def implausible(found: ArmCalibration, arm: ArmModel) -> str | None:
    """Return the reason why a calibration is implausible for a sound arm; None if it is plausible."""
    # Largest plausible friction or offset, fraction of a joint's torque. Above it the joint is worn, braked or blocked.
    most = 0.25 * np.array(arm.joints.torque)
    named = [(f"friction at {v:g} rad/s", f, most) for v, f in zip(found.speeds, found.friction, strict=True)]
    for name, figure, bound in (*named, ("offset", found.offset, np.minimum(most, MOST_OFFSET))):
        value, interval = np.array(figure.value), np.array(figure.interval)
        least = np.full(JOINTS, 0.0) if name != "offset" else -bound
        for j in range(JOINTS):
            if interval[j] > max(MOST_UNSURE, 0.5 * abs(value[j])):
                allowed = max(MOST_UNSURE, 0.5 * abs(value[j]))
                return f"joint {j + 1}: {name} uncertain by {interval[j]:.2f} N·m; at most {allowed:.2f} N·m allowed"
            if not least[j] - interval[j] <= value[j] <= bound[j]:
                return f"joint {j + 1}: {name} {value[j]:.2f} N·m; {least[j]:.2f} to {bound[j]:.2f} N·m allowed"
    return None


def _figures(values: tuple[float, ...]) -> str:
    return f"[{', '.join(f'{value:.5g}' for value in values)}]"


def _table(figure: Measured) -> str:
    return f"value = {_figures(figure.value)}\ninterval = {_figures(figure.interval)}"
