"""A plate with a hole under a hand that is at once where it shall be, as far as the plate lets it: for what a search does."""

from dataclasses import replace

import numpy as np

from drivers.quantities import ImpedanceSetpoint, Pose, Vector
from tests.fakes import Rig
from tests.scripted import Watched

WALL = 1e-3
"""Least depth of a hole whose walls hold the lowest point of the peg, m; from a shallower dent the point slides out."""
Dent = tuple[Vector, float, float]
"""Middle, shape (2,), m, base frame, radius and depth, m."""


class Board(Watched):
    """A plate that bears what is pushed onto it, under a hand that is at once where it shall be."""

    def __init__(self, rig: Rig) -> None:
        super().__init__(rig)
        job = rig.cell.config.job()
        self.part, self.length = job.peg.part, job.peg.length
        self.middle, self.level = np.array(job.hole.centre[:2]), float(job.hole.centre[2])
        self.dents: list[Dent] = []
        self.free = np.zeros(3)
        """Force that the arm reports without contact, N."""
        self.longer = 0.0
        """Length by which the peg reaches further from the hand than the job says, m."""
        self._inside: Dent | None = None

    def put(self, tip: Vector, axis: Vector, closing: Vector) -> None:
        """Put the hand where its peg, straight in it, ends at `tip`, m, with these axes of the peg and of the closing."""
        frame = np.column_stack([-axis, np.cross(closing, -axis), closing])
        self.rig.arm.tcp = Pose(tip + self.length * axis, frame)

    def dig(self, x: float, y: float, radius: float = 4e-3, depth: float = 2e-3) -> Vector:
        """Make a hole or a dent at a place from the middle of the area, m, and return its middle, shape (2,), m, base frame."""
        self.dents.append((self.middle + np.array([x, y]), radius, depth))
        return self.dents[-1][0]

    def _followed(self, setpoint: ImpedanceSetpoint) -> None:
        self.commanded.append(setpoint)
        arm = self.rig.arm
        if setpoint.in_hand is None:
            arm.floor = float(arm.tcp.position[2])  # the hand itself is held, over what the peg has fallen onto
            self._follow(setpoint)
            below = arm.floor - setpoint.tip[2]
        else:
            roll = setpoint.axis if setpoint.roll is None else setpoint.roll
            beyond = self.length + self.longer - setpoint.in_hand.length
            edge = self.part.lowest(setpoint.tip - beyond * setpoint.axis, setpoint.axis, roll)
            place = self._held_by_walls(edge)
            arm.floor = self._ground(place) - float(edge[2] - setpoint.tip[2])
            tip = np.array([*(setpoint.tip[:2] + place - edge[:2]), setpoint.tip[2]])
            self._follow(replace(setpoint, tip=tip))
            below = arm.floor - setpoint.tip[2]
        arm.force = self.free + np.array([0.0, 0.0, 0.0 if arm.is_blocked else max(setpoint.stiffness[2] * below, 0.0)])

    def _ground(self, place: Vector) -> float:
        """Return the height of the surface under a place, shape (2,), m."""
        depths = (depth for middle, radius, depth in self.dents if np.linalg.norm(place - middle) < radius)
        return self.level - max(depths, default=0.0)

    def _held_by_walls(self, edge: Vector) -> Vector:
        """Return where the lowest point of the peg comes that is asked to be at `edge`, shape (2,), m."""
        if edge[2] > self.level or self._inside is None:
            self._inside = next(
                (dent for dent in self.dents if dent[2] >= WALL and np.linalg.norm(edge[:2] - dent[0]) < dent[1]), None
            )
        if edge[2] > self.level or self._inside is None:
            return edge[:2]
        middle, radius, _ = self._inside
        way = edge[:2] - middle
        return middle + way * min(0.999 * radius / max(float(np.linalg.norm(way)), 1e-9), 1.0)
