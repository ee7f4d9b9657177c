"""A peg that slides over a plate lies on it, whatever the speed, the friction and the time step."""

import math

import numpy as np
import pytest

from drivers.quantities import ImpedanceSetpoint, InHandTip, Twist, Vector
from sim.arm.device import SimArm
from sim.contact import table as contact
from sim.world import engine
from tests.rigs import world_of

TILT, PUSH, LANE = math.pi / 4, 8.0, 0.05
"""Tilt of the peg, rad, push, N, and length of the lane, m: of the order of the search's."""
LOW = 10e-6
"""Largest height, m: a thirtieth of the dip of 0.3 mm that the search looks for."""


class Slider:
    """A held peg that is dragged along y past the hole, `beside` m from its axis, over a plate that is level."""

    def __init__(self, beside: float, *sets: str) -> None:
        # A grip that holds: how the peg slips in the hand is another test's matter.
        self.world = world_of("grip.friction=1.5", "hole.area=[0.0001, 0.0001]", *sets)
        self.arm, self.steps = SimArm(self.world), set[float]()
        self.arm.halt()
        self.world.control.drive[engine.DRIVE_FORCE] = 30.0
        self.world.hold(0.0)
        self.axis = np.array([math.sin(TILT), 0.0, math.cos(TILT)])
        self.radius = self.world.scene.size.reach
        # The rim's lowest point is ahead of the end's middle by r cos t, and below it by r sin t.
        lowest = np.array([math.cos(TILT), 0.0, -math.sin(TILT)]) * self.radius
        self.start = self.world.plate.position + np.array([beside, -LANE / 2, 0.0]) - lowest
        self.lane = float(self.start[0])

    def tip(self) -> tuple[Vector, Vector]:
        """Return the middle of the peg's end, m, and its axis."""
        return self.world.end(), self.world.peg_pose().rotation[:, 2].copy()

    def drag(self, speed: float) -> Vector:
        """Set the peg down and drag it; return rows of way past the hole's axis and height of the lowest point, m."""
        tip, axis = self.tip()
        over = self.start + np.array([0.0, 0.0, 0.01])
        for share in np.minimum(np.arange(250) / 200, 1.0):
            blend = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
            way = axis + blend * (self.axis - axis)
            self._follow(tip + blend * (over - tip), way / np.linalg.norm(way), np.zeros(3), 0.01)
        # Friction in the arm's joints keeps it off its setpoint by millimetres: ask for as much more.
        for height in (*[0.01] * 100, *[-PUSH / 1000.0] * 200):
            self._steer(0.1)
            self._follow(self.start + np.array([0.0, 0.0, height]), self.axis, np.zeros(3), 0.01)
        began, velocity, rows = self.world.now(), np.array([0.0, speed, 0.0]), []
        while (elapsed := self.world.now() - began) < LANE / speed:
            self._steer(0.02)
            goal = self.start + elapsed * velocity - np.array([0.0, 0.0, PUSH / 1000.0])
            self._follow(goal, self.axis, velocity, 0.002)
            lowest = self.world.lowest() - self.world.plate.position[2]
            self.steps.add(self.world.physics()[0].opt.timestep)
            rows.append((float(self.tip()[0][1] - self.world.plate.position[1]), lowest))
        return np.array(rows[len(rows) // 5 :])

    def _steer(self, share: float) -> None:
        """Shift the setpoint by a share of how far the tip is off the lane."""
        self.start[0] += share * (self.lane - self.tip()[0][0])

    def _follow(self, goal: Vector, axis: Vector, velocity: Vector, seconds: float) -> None:
        posture = self.world.q
        now = self.world.now()
        self.arm.follow(
            ImpedanceSetpoint(
                id=1,
                tip=goal,
                axis=axis,
                roll=np.array([0.0, -1.0, 0.0]),
                stiffness=np.array([1500.0, 1500.0, 1000.0, 40.0, 40.0, 40.0]),
                damping_ratio=np.array([1.0, 1.0, 1.0, 3.0, 3.0, 3.0]),
                valid_until=now + 0.1,
                in_hand=InHandTip(self.world.pivot()[0], self.world.job.peg.length),
                posture=posture,
                twist=Twist(velocity, np.zeros(3)),
            )
        )
        self.world.wait_until(now + seconds)


@pytest.mark.parametrize(
    ("friction", "speed", "long_steps"),
    [(0.1, 0.05, "true"), (0.1, 0.2, "true"), (0.4, 0.05, "true"), (0.4, 0.2, "true"), (0.4, 0.2, "false")],
)
def test_a_sliding_peg_lies_on_the_plate_everywhere(friction: float, speed: float, long_steps: str) -> None:
    """Along the lane long steps alternate with short ones: the peg's end comes within 3 mm of the hole's edge."""
    slider = Slider(0.0105, f"contact.friction={friction}", f"sim.model.long_steps={long_steps}")
    rows = slider.drag(speed)
    assert np.abs(rows[:, 0]).min() < 1e-3
    assert np.abs(rows[:, 0]).max() > 0.02
    assert np.abs(rows[:, 1]).max() < LOW
    assert slider.steps == ({5e-4, 1e-3} if long_steps == "true" else {5e-4})


def test_penetration_of_a_plate_is_measured() -> None:
    """Contacts softer than the model assumes let a pressed peg sink in."""
    slider = Slider(0.0105, "contact.friction=0.2")
    plate, held = slider.world.plate, slider.world.scene.held
    for model in (held.model, held.twin):
        assert model is not None
        model.geom("plate").user[:] = contact.plate_user(
            plate.half, plate.depth, 0.2, model.opt.timestep, (-1e4, -200.0), outline=plate.outline
        )
    slider.drag(0.1)
    told = slider.world.truth()
    assert told.plate_penetration > 1e-6
    assert told.max_penetration < told.plate_penetration
