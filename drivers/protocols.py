"""The contracts of the devices: what each device can do, independent of its maker."""

from typing import Protocol

from drivers.quantities import ArmState, GripperState, ImpedanceSetpoint, SwitchState, TaxelFrame


class Device(Protocol):
    """A device that is connected and disconnected."""

    def open(self) -> None:
        """Connect to the device; constructing one touches nothing.

        Raises:
            DeviceNotOpenedError: The device cannot be reached; the message names the port, what was found and what to do.
        """

    def close(self) -> None:
        """Disconnect and leave the device safe; harmless when repeated."""


class Clock(Protocol):
    """The cell's time: simulated with stand-ins, monotonic wall time with hardware."""

    def now(self) -> float:
        """Return the time, s."""

    def wait_until(self, stamp: float) -> None:
        """Return when the clock shows `stamp`; at once when that has passed."""


class Arm(Device, Protocol):
    """A torque-controlled arm that realises an impedance at the peg's tip."""

    def follow(self, setpoint: ImpedanceSetpoint) -> None:
        """Follow `setpoint` until the next one comes or its validity ends."""

    def read(self) -> ArmState:
        """Return the newest state; its wrench is the one that the environment exerts on the hand.

        Raises:
            ArmStoppedError: An emergency or protective stop holds the arm.
            ArmReflexError: The arm stopped itself; `reset` is needed.
            ArmSilentError: The newest state is too old, or the connection is gone.
        """

    def halt(self) -> None:
        """Hold the arm still where it is, compliant; may be called from any thread, as a watchdog does."""

    def reset(self) -> None:
        """Leave a reflex or a released stop; after one, nothing else lets the arm move again."""


class Gripper(Device, Protocol):
    """A hand with two parallel fingers."""

    def grip(self, force: float) -> None:
        """Close until `force`, N, is held or the fingers meet."""

    def release(self, width: float) -> None:
        """Open to `width`, m."""

    def read(self) -> GripperState:
        """Return the newest state.

        Raises:
            GripperSilentError: The state is too old, or the hand refused a command.
        """


class Skin(Device, Protocol):
    """A tactile skin board with both fingers on it; its baseline is taken while it is opened."""

    def read(self) -> TaxelFrame:
        """Return the newest scan of all taxels; never waits for a fresh one.

        Raises:
            SkinSilentError: No scan arrived within the configured time.
            SkinUntrustedError: Modules or fingers have changed places since it was opened.
        """


class SuccessSwitch(Device, Protocol):
    """The switch under the hole."""

    def read(self) -> SwitchState:
        """Return the debounced state of the switch."""
