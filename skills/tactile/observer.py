"""Theta at every scan, from frames that come ten times a second, by two Kalman filters that stand for two motions of
the peg.

Between frames the peg either sticks to the pads, so that theta stays, or its tip is held by what it touches and the
fingers turn about it, so that the tip stays and theta follows from the finger's pose. Both hypotheses are carried along
from the last frame; the next frame weighs them, and the two are mixed by their likelihoods ([blom]). A frame that
neither foresaw is a slip and is taken as it is.
"""

import math
from collections import deque
from dataclasses import replace
from typing import Annotated

import numpy as np
from pydantic import Field

from drivers.config_model import ConfigModel
from drivers.frames import end_point
from drivers.quantities import Pose, Vector
from skills.tactile.pose import NO_PEG, PegPose

HISTORY = 100
"""Number of scans for which the finger's pose is remembered, so that the pose at the time of an older frame is known."""
REPEATS = 0.5
"""Share of a frame's variance that the next frames repeat (gains, lattice, pad model) and that no filter removes, fraction."""
STRETCH = 0.1
"""Share of the turn about a fixed tip that may be missing, fraction; the tip is never held quite still."""


class ObserverParams(ConfigModel):
    """How theta may move between frames.

    Source: chosen, not measured; reason in docs/tried/angle.md.
    """

    walk: Annotated[float, Field(gt=0.0, le=1.0)] = 8e-3
    """Standard deviation, after one second, of the part of theta that neither motion foresees, rad."""
    change: Annotated[float, Field(gt=0.0, lt=0.5)] = 0.1
    """Probability that the peg passes from one motion to the other between two frames, fraction."""
    slip: Annotated[float, Field(ge=2.0, le=20.0)] = 4.0
    """Distance of a frame from both motions at which the peg has slipped, standard deviations."""
    longest: Annotated[float, Field(gt=0.0, le=10.0)] = 1.0
    """Time without a frame after which the filters start anew, s."""


class Observer:
    """Follows one peg in the hand."""

    def __init__(self, params: ObserverParams) -> None:
        """Start without any estimate."""
        self._params = params
        self._path: deque[tuple[float, Pose]] = deque(maxlen=HISTORY)
        self._peg = NO_PEG
        self._finger: Pose | None = None
        self._variance = 0.0
        self.pivoting = 0.5
        """Probability that the tip stays and the peg turns in the hand, 0 to 1."""
        self.slips = 0
        """Number of frames that neither motion foresaw."""

    def follow(self, stamp: float, tcp: Pose, length: float, new: PegPose | None) -> PegPose:
        """Return the pose of the peg now; its stamp is that of the newest frame in it.

        Args:
            stamp: Time now, s.
            tcp: T_base_tcp now.
            length: Distance from the finger centre to the peg's end point, m.
            new: A healthy estimate from a frame that has just come, if any; its stamp may lie in the past.
        """
        self._path.append((stamp, tcp))
        if new is not None and (new.stamp > self._peg.stamp or self._finger is None):
            # A frame that was overtaken on its way carries no information that is not known already.
            self._take(new, length)
        if self._finger is None:
            return self._peg
        foreseen = self._foreseen(tcp, length)
        apart = foreseen[1] - foreseen[0]
        shares = np.array([1.0 - self.pivoting, self.pivoting])
        variance = float(shares @ self._grown(stamp, apart)) + shares[0] * shares[1] * apart * apart
        repeated = REPEATS * self._peg.sigma**2
        return replace(self._peg, theta=float(shares @ foreseen), sigma=math.sqrt(variance + repeated))

    def _take(self, new: PegPose, length: float) -> None:
        """Update both hypotheses by a new frame."""
        params, then = self._params, self._finger_at(new.stamp)
        if self._finger is None or new.stamp - self._peg.stamp > params.longest:
            self._begin(new, then, new.theta)
            return
        foreseen = self._foreseen(then, length)
        # A peg looks the same turned by half a turn: the nearest such angle is meant.
        missed = np.array([math.remainder(new.theta - theta, math.pi) for theta in foreseen])
        grown = self._grown(new.stamp, float(foreseen[1] - foreseen[0]))
        spread = grown + new.sigma**2
        away = missed * missed / spread
        if away.min() > params.slip**2:
            self.slips += 1
            near = int(away.argmin())
            self._begin(new, then, float(foreseen[near] + missed[near]))
            return
        before = np.array([1.0 - self.pivoting, self.pivoting])
        before += params.change * (before[::-1] - before)
        likely = before * np.exp(-0.5 * (away - away.min())) / np.sqrt(spread)
        likely /= likely.sum()
        gain = grown / spread
        found = foreseen + gain * missed
        theta = float(likely @ found)
        self._variance = float(likely @ (grown * (1.0 - gain) + (found - theta) ** 2))
        self.pivoting = float(likely[1])
        self._peg, self._finger = replace(new, theta=theta), then

    def _begin(self, new: PegPose, finger: Pose, theta: float) -> None:
        self._peg, self._finger, self._variance = replace(new, theta=theta), finger, new.sigma**2

    def _foreseen(self, tcp: Pose, length: float) -> Vector:
        """Return theta if the peg sticks, and if its tip stays, with the finger at `tcp`, shape (2,), rad."""
        assert self._finger is not None
        stuck = self._peg.theta
        tip, _ = end_point(self._finger, stuck, length)
        x, y, _ = tcp.rotation.T @ (tip - tcp.position)
        return np.array([stuck, stuck + math.remainder(math.atan2(y, x) - stuck, math.tau)])

    def _grown(self, stamp: float, apart: float) -> Vector:
        """Return the variances of both hypotheses at `stamp`, shape (2,), rad²."""
        base = self._variance + self._params.walk**2 * max(stamp - self._peg.stamp, 0.0)
        return np.array([base, base + (STRETCH * apart) ** 2])

    def _finger_at(self, stamp: float) -> Pose:
        """Return the finger's pose when a frame was measured, to the nearest scan."""
        return min(self._path, key=lambda entry: abs(entry[0] - stamp))[1]
