"""What the arm reports as a force where nothing touches, and how much that scatters; pure.

An arm estimates the external wrench from torques that its model does not explain: friction, payload and masses leave some
newtons over, which change with the posture. Where the hand rests in free air the mean of the readings is that offset, and
their scatter the noise that thresholds have to stay clear of.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from pydantic import Field

from drivers.config_model import ConfigModel
from drivers.errors import WrenchOffsetError, WrenchReversedError
from drivers.quantities import ArmState, Vector, Wrench

SCANS = 20
"""Number of scans at rest that the wrench is zeroed by."""
GUARD = 4.0
"""Standard deviations by which a mean of readings has to differ from 0 to be more than noise."""
STILL = 2.0
"""Largest change of the mean force from the first to the second half of the scans, N, beside what noise explains."""


class WrenchConfig(ConfigModel):
    """[wrench]: what may be believed of the external wrench that the arm estimates."""

    offset: Annotated[float, Field(gt=0.0, le=60.0)] = 35.0
    """Largest force that the arm may report where nothing touches, N; a larger one is no offset of an estimate, but contact or a
    wrong payload. Source: docs/tried/search.md.
    """
    noise: Annotated[float, Field(gt=0.0, le=20.0)] = 5.0
    """Largest standard deviation of a component of that force from scan to scan, N. Source: docs/tried/search.md."""


@dataclass(frozen=True, slots=True, eq=False)
class WrenchZero:
    """The offset of the estimated wrench in one posture."""

    force: Vector = field(default_factory=lambda: np.zeros(3))
    """Force that is reported where nothing touches, shape (3,), N, base frame."""
    torque: Vector = field(default_factory=lambda: np.zeros(3))
    """Torque about the TCP that is reported there, shape (3,), N·m, base frame."""
    noise: float = 0.0
    """Standard deviation of a component of the force from scan to scan, N."""

    def taken_from(self, arm: ArmState) -> ArmState:
        """Return the state with the offset taken from its wrench."""
        felt = Wrench(arm.wrench.force - self.force, arm.wrench.torque - self.torque)
        # `dataclasses.replace` costs three times as much, in every scan.
        return ArmState(
            stamp=arm.stamp,
            q=arm.q,
            dq=arm.dq,
            tcp=arm.tcp,
            wrench=felt,
            elbow=arm.elbow,
            setpoint_age=arm.setpoint_age,
            commanded=arm.commanded,
            unexplained=arm.unexplained,
        )

    def guarded(self, threshold: float, scans: int) -> float:
        """Return the threshold, N, for the mean of so many readings: not less than their noise leaves room for."""
        return max(threshold, GUARD * self.noise / math.sqrt(scans))

    def require_sense(self, forces: Sequence[float], push: float) -> None:
        """Make sure that the reported wrench is the one on the hand, by what it was while a surface should have borne a push.

        Args:
            forces: Force along z in the last scans of the push, N; upwards is positive.
            push: Force from which on the surface would have counted as touched, N.

        Raises:
            WrenchReversedError: The mean force is as large, and points down.
        """
        mean = sum(forces) / len(forces)
        if mean < -self.guarded(push, len(forces)):
            raise WrenchReversedError(
                f"arm: reports {-mean:.0f} N downwards while it presses down; a force upwards expected: the sign of its"
                " external wrench is reversed"
            )


def zero_of(wrenches: Sequence[Wrench], config: WrenchConfig) -> WrenchZero:
    """Return the offset and the noise of readings that were taken at rest in free air.

    Raises:
        WrenchOffsetError: They drift, scatter too much or are too large: something touches, or the arm's payload is wrong.
    """
    forces = np.array([wrench.force for wrench in wrenches])
    mean = forces.mean(axis=0)
    first, second = np.array_split(forces, 2)
    noise = math.sqrt((first.var(axis=0, ddof=1).mean() + second.var(axis=0, ddof=1).mean()) / 2.0)
    drift, size = float(np.linalg.norm(second.mean(axis=0) - first.mean(axis=0))), float(np.linalg.norm(mean))
    if size > config.offset:
        raise WrenchOffsetError(
            f"arm: {size:.0f} N reported in free air; wrench.offset = {config.offset:g} N allowed: see what touches the hand,"
            " and the payload that the arm's controller knows"
        )
    if noise > config.noise:
        raise WrenchOffsetError(
            f"arm: force scatters by {noise:.1f} N in free air; wrench.noise = {config.noise:g} N allowed"
        )
    # The difference of two means of half the scans, in three components.
    if drift > STILL + GUARD * noise * math.sqrt(3.0 * 4.0 / len(forces)):
        raise WrenchOffsetError(
            f"arm: force changes by {drift:.1f} N in free air while the hand rests: something touches it"
        )
    return WrenchZero(mean, np.mean([wrench.torque for wrench in wrenches], axis=0), noise)
