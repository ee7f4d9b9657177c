"""Pads of the two fingers under a peg: loads in, pressure on the taxels out; quasi-static, without side effects.

Along the contact line, s from the finger centre towards the peg's tip, the depth is delta0 + u + phi·s in the left pad
and delta0 - u - phi·s in the right one; a negative depth means no contact. The load of a pad of thickness t is k·t·(x^n
+ x²/(1 - x)) per metre, with x = delta/t; for the exponent n = 1 it is k·delta / (1 - x). The cylinder spreads the load
over its width as on a bed of springs, and the elastomer blurs it before the taxels.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from drivers.parts import Peg
from drivers.quantities import Pose, Vector
from drivers.skin.layout import Layout, finger_positions, pad_size
from sim.config import PadConfig
from sim.hand.grip_limits import span
from sim.hand.pad_solver import CELL, lie, spread

LINE_POINTS = 33
LEVER_LIMIT = 0.9
"""Limit on loads that would lift the peg off a pad or tilt it out, fraction of the largest load that the pads bear."""


@dataclass(frozen=True, slots=True)
class PadLoad:
    """Load of the pads: the grip, and the external forces on the peg."""

    theta: float
    """In-hand angle theta about the closing axis, rad: the peg points along (cos t, sin t, 0) of the finger frame."""
    offset: float
    """Distance of the peg's axis from the finger centre along (-sin t, cos t, 0), m."""
    grip_force: float
    """Grip force of the hand, N; each pad's load without external force on the peg."""
    across: float
    """Force on the peg along z of the finger frame, towards the left pad, N."""
    tilting: float
    """Moment of the forces across the pads about the finger centre, the sum of force times lever s along the peg, N·m;
    the lever of the tip is `reach_tip`.
    """
    reach_tip: float
    """Length of the peg from the finger centre towards its tip, m."""
    reach_back: float
    """Length of the peg from the finger centre to its end inside the hand, m."""
    width: float
    """Diameter of a round peg, or width of the faces that lie in the pads, m."""
    is_flat: bool = False
    """True if two flat faces of the peg lie in the pads."""


TOUCH = PadLoad(
    theta=0.0, offset=0.0, grip_force=1.0, across=0.0, tilting=0.0, reach_tip=0.05, reach_back=0.01, width=0.008
)
"""Load with contact on every pad, for warming up."""


def load_of(peg: Peg, tcp: Pose, pose: Pose, grip_force: float, force: Vector, torque: Vector) -> PadLoad:
    """Return the load of the pads: the grip, and the reaction to external forces; the peg's inertia is neglected.

    Args:
        peg: The part.
        tcp: T_base_tcp, at the finger centre.
        pose: Pose of the peg's centre, z from its end upward, base frame.
        grip_force: Grip force of the hand, N.
        force: Force of the plates on the peg, shape (3,), N, base frame.
        torque: Torque of that force about the finger centre, shape (3,), N·m, base frame.
    """
    axis = tcp.rotation.T @ pose.rotation[:, 2]
    theta = math.atan2(-axis[1], -axis[0])
    way = pose.position - tcp.position
    lateral = tcp.rotation @ np.array([-math.sin(theta), math.cos(theta), 0.0])
    closing = tcp.rotation[:, 2]
    half = (peg.length + peg.overhang) / 2
    reach = half - float(way @ pose.rotation[:, 2])
    return PadLoad(
        theta=theta,
        offset=float(way @ lateral),
        grip_force=grip_force,
        across=float(force @ closing),
        # A force f along z at the lever s along the peg exerts s·f about (z × peg), with opposite sign.
        tilting=-float(torque @ lateral),
        reach_tip=reach,
        reach_back=2 * half - reach,
        width=peg.part.face.width,
        is_flat=peg.part.face.is_flat,
    )


def contact_span(load: PadLoad, length: float, width: float) -> tuple[float, float]:
    """Return the ends of the contact line on a pad of this size, two values of s, m; equal if the peg misses the pad."""
    ends: tuple[float, float] = span(load.theta, load.offset, load.reach_tip, load.reach_back, length / 2, width / 2)
    return ends


@dataclass(frozen=True, slots=True, eq=False)
class Pressing:
    """Position and depth of the peg in the pads."""

    low: float
    """Start of the contact line, m along the peg from the finger centre."""
    high: float
    """End of the contact line, m along the peg from the finger centre."""
    delta0: float
    """Mean depth, m."""
    u: float
    """Displacement of the peg towards the left pad at the finger centre, m."""
    phi: float
    """Tilt of the peg towards the left pad, rad."""


class Pads:
    """Two pads over taxels."""

    def __init__(self, config: PadConfig, layout: Layout, misplaced: Vector | None = None) -> None:
        """Set up pads of the size of `layout`.

        Args:
            config: Elastomer and taxels.
            layout: Layout of the two modules of a finger.
            misplaced: Offset of each taxel from its position in the layout, shape (2, taxels, 2), m; None for no offsets.
        """
        self.length, self.width = pad_size(layout)
        self._config = config
        self._foundation = config.stiffness / self.length
        self._cells, self._weights = (
            taxel_weights(layout, config.blur, config.taxel_diameter)
            if misplaced is None
            else weights_at(finger_positions(layout) + misplaced, layout, config.blur, config.taxel_diameter)
        )
        # The first contact of a process compiles code, which must not happen during a run with a PLC watchdog.
        self.pressure(TOUCH)

    def press(self, load: PadLoad) -> Pressing:
        """Return position and depth of the peg under `load`.

        A push across the pads does not change the distance between the fingers, as in a hand with self-locking gears: the
        pads stiffen, and both together carry more than twice the grip force. Newton's method minimises the potential
        energy of the pads. The energy is convex, so that the solution is unique.
        """
        low, high = contact_span(load, self.length, self.width)
        if high - low < CELL or load.grip_force <= 0.0:
            return Pressing(low, low, 0.0, 0.0, 0.0)
        step = (high - low) / LINE_POINTS
        s = low + step * (np.arange(LINE_POINTS) + 0.5)
        mean, pad = load.grip_force / (high - low) / self._foundation, self._config
        # Mean depth for n = 1, from m = delta0 / (1 - delta0/t) with the mean load m: delta0 = m / (1 + m/t).
        delta0 = mean / (1.0 + mean / pad.thickness)
        if pad.exponent != 1.0:
            # Under the grip alone every point of both pads carries the mean load.
            one = np.ones((1, 1))
            delta0 = float(lie(one, np.array([mean]), np.array([delta0]), 0.0, pad.thickness, pad.exponent)[0])
        across, tilting = _bearable(load, low, high)
        one = np.ones_like(s)
        motions = np.concatenate([[one, s], [-one, -s]], axis=1)
        wanted = np.array([across, tilting]) / (step * self._foundation)
        u, phi = lie(motions, wanted, np.zeros(2), delta0, pad.thickness, pad.exponent)
        return Pressing(low, high, float(delta0), float(u), float(phi))

    def pressure(self, load: PadLoad) -> Vector:
        """Return the pressure on each taxel, shape (2, taxels), left finger first, Pa."""
        pressing = self.press(load)
        if pressing.high <= pressing.low:
            return np.zeros(self._weights.shape[:2])
        # The line of a round peg ends at the pad's edges. A face needs no such limit: the grid has no cells beyond them.
        ends = (-load.reach_back, load.reach_tip) if load.is_flat else (pressing.low, pressing.high)
        taxels = np.zeros(self._weights.shape[:2])
        spread(
            ends,
            (pressing.delta0, pressing.u, pressing.phi),
            (load.theta, load.offset, load.width, load.is_flat),
            (self._foundation, self._config.thickness, self._config.exponent),
            self._cells,
            self._weights,
            taxels,
        )
        return taxels


def _bearable(load: PadLoad, low: float, high: float) -> tuple[float, float]:
    """Return `across` and `tilting`, limited to loads that pads without tension can bear."""
    most = 2.0 * LEVER_LIMIT * load.grip_force
    across = min(max(load.across, -most), most)
    left, right = load.grip_force + across / 2, load.grip_force - across / 2
    upper, lower = left * high - right * low, left * low - right * high
    middle, reach = (upper + lower) / 2, LEVER_LIMIT * (upper - lower) / 2
    return across, min(max(load.tilting, middle - reach), middle + reach)


@lru_cache
def taxel_weights(layout: Layout, blur: float, diameter: float) -> tuple[Vector, Vector]:
    """Return the result of `weights_at` for taxels at their positions in the layout."""
    return weights_at(finger_positions(layout), layout, blur, diameter)


def weights_at(places: Vector, layout: Layout, blur: float, diameter: float) -> tuple[Vector, Vector]:
    """Return the grid's cells, shape (n, 2), m, and the share of each cell's pressure in a taxel, shape (2, taxels, n).

    The point spread is a Gaussian averaged over the taxel's disc; on an infinite pad the shares of a taxel add up to 1.

    Args:
        places: Centres of the taxels in the plane of the pad, shape (2, taxels, 2), m.
        layout: Layout of the taxels, which defines the pad's size.
        blur: Standard deviation of the point spread, m.
        diameter: Diameter of a taxel's averaging area, m.
    """
    length, width = pad_size(layout)
    x, y = ((np.arange(round(size / CELL)) + 0.5) * size / round(size / CELL) - size / 2 for size in (length, width))
    cells = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    area = (x[1] - x[0]) * (y[1] - y[0])
    number = np.arange(200) + 0.5
    # The sunflower pattern covers a disc evenly.
    radius, turn = diameter / 2 * np.sqrt(number / number.size), np.pi * (1 + 5**0.5) * number
    disc = np.column_stack([radius * np.cos(turn), radius * np.sin(turn)])
    away = places[:, :, None, :] - cells
    distance = np.sqrt((away**2).sum(axis=-1))
    table = np.linspace(0.0, diameter / 2 + 6 * blur, 400)
    gap = (table[:, None] - disc[:, 0]) ** 2 + disc[:, 1] ** 2
    spread = np.exp(-gap / (2 * blur**2)).mean(axis=1) * area / (2 * np.pi * blur**2)
    weights = np.interp(distance, table, spread, right=0.0)
    return cells, weights
