"""The calibration of one arm, friction and remainder of gravity of each joint: its file, its plausibility, and what learning begins with."""

from datetime import date
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from drivers.arm.learning import DRY_RATE, FIGURES, MOST_OFFSET, SMOOTH_RATE, doubts
from drivers.arm.model import JOINTS, ArmModel, Frictions
from drivers.config_model import ConfigModel
from drivers.errors import ConfigError
from drivers.figures_file import read_figures, write_whole
from drivers.quantities import Vector

Speed = Annotated[float, Field(gt=0.0, le=3.0)]
Offset = Annotated[float, Field(ge=-50.0, le=50.0)]
Offsets = tuple[Offset, Offset, Offset, Offset, Offset, Offset, Offset]

MOST_SHARE = 0.25
"""Largest friction or offset of a joint that is believed, fraction of its largest torque: a joint that keeps more to itself is worn, braked
or held by something.
"""
MOST_UNSURE = 0.3
"""Largest half width of the interval of a friction or an offset, N·m; figures that scatter more were disturbed."""
CHANGED = 0.2
"""Standard deviation of a joint's friction from day to day, fraction: grease warms up; assumed."""
ELSEWHERE = 0.3
"""Share of an arm's likely offset by which it differs in another posture; assumed, since one posture is calibrated."""


class Measured(ConfigModel):
    """One figure of each joint, with half the width of its 95 % interval; N·m."""

    value: Offsets
    interval: Frictions

    def deviation(self) -> Vector:
        """Return the standard deviation of each joint's figure, shape (7,), N·m."""
        return np.array(self.interval) / 1.96


class ArmCalibration(ConfigModel):
    """Calibration of one arm."""

    date: date
    arm: str
    """Name of the arm's model."""
    unit: str
    """The one arm that was measured, as `CellConfig.arm_unit` names it."""
    speeds: Annotated[tuple[Speed, ...], Field(min_length=2)]
    """Speeds at which each joint was moved, rad/s."""
    friction: tuple[Measured, ...]
    """Friction of each joint at each of these speeds: half the difference between the torques there and back."""
    offset: Measured
    """Mean of the torques there and back: what compensation of gravity leaves over, and what of friction is unequal."""
    dry: Measured
    """Level of the dry friction that fits the frictions best."""
    smooth: Measured
    """Level of the friction that grows with velocity, fitted together with the dry one."""
    unexplained: Frictions
    """Root mean square of what the figures leave unexplained while all joints move together, N·m."""

    def believed(self, arm: ArmModel) -> tuple[Vector, Vector]:
        """Return the figures that learning begins with, and their standard deviations, each shape (7, 4); see `drivers.arm.learning`.

        They are less sure than they were measured, since friction changes from day to day and gravity with the posture, but
        never less sure than where nothing is known. The rotors are left to learning.
        """
        likely, figures = doubts(arm), np.zeros((JOINTS, FIGURES))
        figures[:, 0], figures[:, 1], figures[:, 2] = self.dry.value, self.smooth.value, self.offset.value
        may_change = np.column_stack([CHANGED * figures[:, 0], CHANGED * figures[:, 1], ELSEWHERE * likely[:, 2]])
        measured = np.column_stack([figure.deviation() for figure in (self.dry, self.smooth, self.offset)])
        deviations = likely.copy()
        deviations[:, :3] = np.minimum(np.hypot(measured, may_change), likely[:, :3])
        return figures, deviations

    def predicted(self, dq: Vector) -> Vector:
        """Return the torque on each joint that these figures explain at velocities, shape (..., 7), rad/s; N·m."""
        friction = np.array(self.dry.value) * np.tanh(dq / DRY_RATE)
        total: Vector = friction + np.array(self.smooth.value) * np.tanh(dq / SMOOTH_RATE) + np.array(self.offset.value)
        return total

    def write(self, path: Path) -> None:
        """Write a file whole or not at all.

        Raises:
            ConfigError: The file cannot be written; one that was there before stays.
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
        ConfigError: There is no such file, it has another form, is of another arm, or holds figures that no arm can have.
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
    """Return in words what in a calibration no sound arm can have; None where all of it is plausible."""
    most = MOST_SHARE * np.array(arm.joints.torque)
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
