"""Twist of the peg in soft pads by a moment about the closing axis, between two frames of the skin; pure."""

import math
from collections import deque

MEMORY = 10
"""Memory of the learnt compliance, frames: each new frame reduces the weight of the earlier frames by 1/`MEMORY`."""
NOISE = 0.014
"""Standard deviation of the difference of theta between two frames, rad: sqrt(2) times the 0.01 rad of one frame. Source: assumed."""
KEPT = 500
"""Number of newest scans with stored moments; no frame is older than these scans."""


class GripTwist:
    """Learns the compliance of the grip from frames: twist c M, with c by least squares under a normal prior about 0."""

    def __init__(self, softest: float) -> None:
        """Start from a rigid grip; `softest` is the compliance of the softest grip, rad/(N·m)."""
        self._softest = softest
        self.moments = deque[tuple[float, float]](maxlen=KEPT)
        """Times, s, and moments, N·m, of the last scans."""
        self._crossed = self._squares = 0.0
        self.compliance = 0.0
        """Compliance of the grip: twist of the peg over the moment, rad/(N·m)."""

    def moment(self, stamp: float) -> float:
        """Return the moment that was measured nearest to a time, N·m."""
        nearest, least = 0.0, math.inf
        for felt_at, felt in reversed(self.moments):
            away = felt_at - stamp if felt_at > stamp else stamp - felt_at
            if away > least:
                break
            nearest, least = felt, away
        return nearest

    def learn(self, moment: float, theta: float) -> None:
        """Update the compliance by the changes of moment, N·m, and theta, rad, from one frame to the next."""
        kept = 1.0 - 1.0 / MEMORY
        self._crossed = kept * self._crossed + moment * theta
        self._squares = kept * self._squares + moment * moment
        if self._crossed <= 0.0 or self._softest == 0.0:
            self.compliance = 0.0
            return
        # c = sum(dM dtheta) / (sum(dM^2) + sigma^2 / c_0^2), the mode of its posterior.
        self.compliance = min(self._crossed / (self._squares + (NOISE / self._softest) ** 2), self._softest)
