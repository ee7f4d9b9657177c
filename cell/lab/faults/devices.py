"""Devices with faults between device and cell, switched on and off at run time."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from drivers.errors import ArmReflexError, ArmSilentError, ArmStoppedError, GripperSilentError
from drivers.protocols import Arm, Gripper, SuccessSwitch
from drivers.quantities import ArmState, GripperState, ImpedanceSetpoint, SwitchState, Wrench
from drivers.skin.health import Counts

Told = TypeVar("Told")
Change = Callable[[Told], Told]


def _as_it_is(told: Told) -> Told:
    return told


@dataclass(slots=True)
class FaultyArm:
    """An arm with modified states that ignores commands while `is_deaf` is set."""

    arm: Arm
    change: Change[ArmState] = _as_it_is
    is_deaf: bool = False

    def open(self) -> None:
        """Connect."""
        self.arm.open()

    def close(self) -> None:
        """Disconnect."""
        self.arm.close()

    def follow(self, setpoint: ImpedanceSetpoint) -> None:
        """Hold a setpoint unless `is_deaf` is set."""
        if not self.is_deaf:
            self.arm.follow(setpoint)

    def read(self) -> ArmState:
        """Return the newest state after modification."""
        return self.change(self.arm.read())

    def halt(self) -> None:
        """Hold still."""
        self.arm.halt()

    def reset(self) -> None:
        """Leave a reflex or a stop if its cause is gone."""
        self.arm.reset()


@dataclass(slots=True)
class FaultyGripper:
    """A hand with modified states that neither opens nor closes while it is stuck."""

    gripper: Gripper
    change: Change[GripperState] = _as_it_is
    is_stuck: bool = False

    def open(self) -> None:
        """Connect."""
        self.gripper.open()

    def close(self) -> None:
        """Disconnect."""
        self.gripper.close()

    def grip(self, force: float) -> None:
        """Close unless it is stuck."""
        if not self.is_stuck:
            self.gripper.grip(force)

    def release(self, width: float) -> None:
        """Open unless it is stuck."""
        if not self.is_stuck:
            self.gripper.release(width)

    def read(self) -> GripperState:
        """Return the newest state after modification."""
        return self.change(self.gripper.read())


@dataclass(slots=True)
class FaultySwitch:
    """A switch with a modified state."""

    switch: SuccessSwitch
    change: Change[SwitchState] = _as_it_is

    def open(self) -> None:
        """Connect."""
        self.switch.open()

    def close(self) -> None:
        """Disconnect."""
        self.switch.close()

    def read(self) -> SwitchState:
        """Return the state after modification."""
        return self.change(self.switch.read())


# Modified readings.


def reflex(_: ArmState) -> ArmState:
    """Report a stop by a reflex."""
    raise ArmReflexError("arm: reflex: joint 4 above its torque limit")


def stopped(_: ArmState) -> ArmState:
    """Report an external stop."""
    raise ArmStoppedError("arm: protective stop")


def silent_arm(_: ArmState) -> ArmState:
    """Raise instead of reporting a state."""
    raise ArmSilentError("arm: newest state 0.5 s old > 0.1 s limit")


def no_number(state: ArmState) -> ArmState:
    """Report a wrench that is not a number."""
    return replace(state, wrench=Wrench(np.full(3, np.nan), np.full(3, np.nan)))


def beyond_any_sensor(state: ArmState) -> ArmState:
    """Report a force beyond the range of any sensor."""
    return replace(state, wrench=Wrench(np.full(3, 1e308), state.wrench.torque))


def no_stamp(state: ArmState) -> ArmState:
    """Report a time that is not a number."""
    return replace(state, stamp=math.nan)


def still() -> Change[ArmState]:
    """Report the first state forever, each time as a fresh one."""
    first: list[ArmState] = []

    def change(state: ArmState) -> ArmState:
        first.append(state)
        return replace(first[0], stamp=state.stamp, setpoint_age=state.setpoint_age)

    return change


def no_joint(state: ArmState) -> ArmState:
    """Report a joint that is not a number."""
    return replace(state, q=np.where(np.arange(state.q.size) == 3, np.nan, state.q))


def offset_wrench(state: ArmState) -> ArmState:
    """Report 15 N more along z than the true force."""
    return replace(state, wrench=Wrench(state.wrench.force + np.array([0.0, 0.0, 15.0]), state.wrench.torque))


def silent_hand(_: GripperState) -> GripperState:
    """Raise instead of reporting a state."""
    raise GripperSilentError("gripper: newest state 1.0 s old > 0.5 s limit")


def frozen() -> Change[Counts]:
    """Return the first reading forever."""
    first: list[Counts] = []

    def change(counts: Counts) -> Counts:
        first.append(counts)
        return first[0]

    return change


def filled(value: int) -> Change[Counts]:
    """Return one value, counts, with the noise of a live converter, in all taxels."""
    rng = np.random.default_rng(0)
    return lambda counts: (value + rng.integers(-3, 4, counts.shape)).clip(0).astype(counts.dtype)


def shifted(counts: Counts) -> Counts:
    """Return 4000 counts more in the left finger."""
    moved = counts.astype(np.int64)
    moved[0] += 4000
    return moved.clip(0, 42_000).astype(counts.dtype)


def modules_swapped(counts: Counts) -> Counts:
    """Return readings with the two modules of each finger swapped."""
    return np.roll(counts, counts.shape[1] // 2, axis=1)


def fingers_swapped(counts: Counts) -> Counts:
    """Return each finger's readings from the other one's taxels."""
    return counts[::-1].copy()


def at_random() -> Change[Counts]:
    """Return random readings between zero and full scale."""
    rng = np.random.default_rng(0)
    return lambda counts: rng.integers(0, 42_000, counts.shape).astype(counts.dtype)


def flapping() -> Change[SwitchState]:
    """Report another state at every read."""
    told = [SwitchState.OPEN, SwitchState.CLOSED]

    def change(_: SwitchState) -> SwitchState:
        told.reverse()
        return told[0]

    return change
