"""The simulated arm as an Arm."""

import math

from drivers import impedance, setpoint_words
from drivers.quantities import ArmState, ImpedanceSetpoint, Pose, Vector, Wrench
from sim.world.physics import World


class SimArm:
    """Runs the impedance law inside the loop of the physics, at the arm's control rate."""

    def __init__(self, world: World, law: Vector | None = None) -> None:
        """Attach to the physics of the cell with the arm.

        `law` is the initial state of the law; None starts the law without any learnt state.
        """
        self._world, self._elbow = world, world.arm.kinematics.elbow - 1
        if law is not None:
            world.control.law[:] = law

    def open(self) -> None:
        """Hold the present pose."""
        self.halt()

    def close(self) -> None:
        """Hold the present pose."""
        self.halt()

    def follow(self, setpoint: ImpedanceSetpoint) -> None:
        """Track `setpoint` until the next one arrives or its validity ends."""
        control = self._world.control
        control.words[:] = setpoint_words.pack(setpoint, self._world.pace.stamp)
        control.law[impedance.IS_HOLDING] = 0.0

    def halt(self) -> None:
        """Hold the present pose, compliant."""
        self._world.control.words[setpoint_words.VALID_UNTIL] = -math.inf
        self._world.control.law[impedance.IS_HOLDING] = 0.0

    def reset(self) -> None:
        """Hold the present pose; the simulated arm has no reflexes."""
        self.halt()

    def read(self) -> ArmState:
        """Return the newest state.

        If the arm is ideal, the external wrench is the plates' force on the peg, low-passed over 5 ms.
        """
        world = self._world
        now, control = world.pace.stamp, world.control
        q, dq, wrench, position, rotation, commanded, unexplained = world.scanned()
        words = control.words
        return ArmState(
            stamp=now,
            q=q,
            dq=dq,
            tcp=Pose(position, rotation),
            elbow=self._elbow,
            wrench=Wrench(wrench[:3], wrench[3:]),
            setpoint_age=now - words[setpoint_words.STAMP] if words[setpoint_words.VALID_UNTIL] >= now else math.inf,
            commanded=commanded,
            unexplained=unexplained,
        )
