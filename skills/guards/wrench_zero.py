"""Offset and noise of the arm's estimated wrench in free air; pure.

An arm estimates the external wrench from torques that its model does not explain. Errors of friction, payload and masses
leave an offset of some newtons, which changes with the posture. While the hand rests in free air, the mean of the readings
is this offset. Their standard deviation is the noise, which thresholds must exceed.
"""

import logging
import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from pydantic import Field

from drivers.config_model import ConfigModel, Figure, Quantity, Source
from drivers.errors import WrenchOffsetError, WrenchReversedError
from drivers.quantities import ArmState, Vector, Wrench

logger = logging.getLogger(__name__)

SCANS = 20
"""Number of scans at rest used to zero the wrench."""
GUARD = 4.0
"""Distance of a mean of readings from 0 above which it is not noise, standard deviations of the mean."""
STILL = 2.0
"""Largest change of the mean force from the first to the second half of the scans, N; the effect of noise is added. Source: chosen, not measured."""


class WrenchConfig(ConfigModel):
    """[wrench]: limits on the offset and noise of the arm's estimated external wrench."""

    offset: Annotated[float, Field(gt=0.0, le=60.0), Quantity("N"), Source("docs/tried/search.md")] = 35.0
    """Largest force that the arm may report in free air, N; the cause of a larger force is contact or a wrong payload."""
    noise: Annotated[float, Figure("N"), Field(exclude=True), Source("docs/tried/search.md")] = 5.0
    """Largest standard deviation of a component of the force in free air, N."""


@dataclass(frozen=True, slots=True, eq=False)
class WrenchZero:
    """Offset of the estimated wrench in one posture."""

    force: Vector = field(default_factory=lambda: np.zeros(3))
    """Reported force in free air, shape (3,), N, base frame."""
    torque: Vector = field(default_factory=lambda: np.zeros(3))
    """Reported torque about the TCP in free air, shape (3,), N·m, base frame."""
    noise: float = 0.0
    """Standard deviation of a component of the force from scan to scan, N."""

    def guarded(self, threshold: float, scans: int) -> float:
        """Return the threshold, N, for the mean of `scans` readings, raised if noise requires it."""
        # max(threshold, GUARD sigma / sqrt(n))
        return max(threshold, GUARD * self.noise / math.sqrt(scans))

    def require_sense(self, forces: Sequence[float], push: float) -> None:
        """Check the sign of the reported wrench after a push that should have met a surface.

        Args:
            forces: Force along z in the last scans of the push, N; upwards is positive.
            push: Force at which the surface would have counted as touched, N.

        Raises:
            WrenchReversedError: The mean force exceeds the threshold downwards.
        """
        mean = sum(forces) / len(forces)
        if mean < -self.guarded(push, len(forces)):
            raise WrenchReversedError(
                f"arm: reports {-mean:.0f} N downwards while it presses down; a force upwards expected: the sign of its"
                " external wrench is reversed"
            )


def zero_of(wrenches: Sequence[Wrench], config: WrenchConfig) -> WrenchZero:
    """Return the offset and the noise of readings at rest in free air.

    Raises:
        WrenchOffsetError: The readings drift, scatter too much or are too large: the hand is in contact, or the payload is wrong.
    """
    forces = np.array([wrench.force for wrench in wrenches])
    mean = forces.mean(axis=0)
    first, second = np.array_split(forces, 2)
    noise = math.sqrt((first.var(axis=0, ddof=1).mean() + second.var(axis=0, ddof=1).mean()) / 2.0)
    drift, size = float(np.linalg.norm(second.mean(axis=0) - first.mean(axis=0))), float(np.linalg.norm(mean))
    if size > config.offset:
        raise WrenchOffsetError(
            f"arm: {size:.0f} N reported in free air; wrench.offset = {config.offset:g} N allowed: check what touches the hand,"
            " and the payload set in the arm's controller"
        )
    if noise > config.noise:
        raise WrenchOffsetError(f"arm: force scatters by {noise:.1f} N in free air; {config.noise:g} N allowed")
    # Standard deviation of the difference of two means of n/2 readings, in three components: sigma sqrt(3 · 4 / n)
    if drift > STILL + GUARD * noise * math.sqrt(3.0 * 4.0 / len(forces)):
        raise WrenchOffsetError(
            f"arm: force changes by {drift:.1f} N in free air while the hand rests: something touches it"
        )
    return WrenchZero(mean, np.mean([wrench.torque for wrench in wrenches], axis=0), noise)


class ZeroedWrench:
    """External wrench without its offset in free air."""

    def __init__(self, config: WrenchConfig | None = None) -> None:
        """Start without an offset; `config` limits the offset and the noise."""
        self._config = config or WrenchConfig()
        self._reported: deque[Wrench] = deque(maxlen=SCANS)
        """Wrenches reported by the arm in the last scans."""
        self.zero = WrenchZero()
        """Offset of the wrench in free air; it is subtracted from every observation."""

    def taken_from(self, arm: ArmState) -> ArmState:
        """Record the reported wrench of one scan, and return the state without the offset."""
        self._reported.append(arm.wrench)
        zero = self.zero
        felt = Wrench(arm.wrench.force - zero.force, arm.wrench.torque - zero.torque)
        # This runs at every scan, and `dataclasses.replace` would take three times as long.
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

    def set_zero(self) -> None:
        """Set the offset to the mean over the last scans; the hand must have rested in free air.

        Raises:
            WrenchOffsetError: The wrenches are implausible for free air.
        """
        self.zero = zero_of(self._reported, self._config)
        x, y, z = self.zero.force
        logger.info("wrench zeroed: %.1f, %.1f, %.1f N in free air, noise %.1f N", x, y, z, self.zero.noise)
