"""The contracts of the devices: the functions of each device, independent of its maker."""

from typing import Protocol

from drivers.quantities import ArmState, GripperState, ImpedanceSetpoint, SwitchState, TaxelFrame


class Device(Protocol):
    """A device with a connection that can be opened and closed."""

    def open(self) -> None:
        """Connect to the device; the constructor accesses no hardware.

        Raises:
            DeviceNotOpenedError: The device cannot be reached; the message gives the port, the cause and the remedy.
        """

    def close(self) -> None:
        """Disconnect and leave the device safe; harmless when repeated."""


class Clock(Protocol):
    """The cell's time: simulated time, or monotonic wall time with hardware."""

    def now(self) -> float:
        """Return the time, s."""

    def wait_until(self, stamp: float) -> None:
        """Return when the clock shows `stamp`, s; return at once if it has passed."""


class Arm(Device, Protocol):
    """A torque-controlled arm that realises an impedance at the peg's tip."""

    def follow(self, setpoint: ImpedanceSetpoint) -> None:
        """Follow `setpoint` until the next one comes or its validity ends."""

    def read(self) -> ArmState:
        """Return the newest state; its wrench acts from the environment on the hand.

        Raises:
            ArmStoppedError: An emergency or protective stop holds the arm.
            ArmReflexError: The arm stopped itself; `reset` is needed.
            ArmSilentError: The newest state is too old, or the connection is lost.
        """

    def halt(self) -> None:
        """Hold the arm still at its present pose, compliant; any thread may call it, for example a watchdog."""

    def reset(self) -> None:
        """Enable motion after a reflex or a released stop. If a stop is still pressed, raise `ArmStoppedError`."""


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
    """A tactile skin board with both fingers; opening it measures the baseline."""

    def read(self) -> TaxelFrame:
        """Return the newest scan of all taxels; never wait for the next scan.

        Raises:
            SkinSilentError: No scan arrived within the configured time.
            SkinUntrustedError: Modules or fingers were exchanged since the skin was opened.
        """


class SuccessSwitch(Device, Protocol):
    """The switch under the hole."""

    def read(self) -> SwitchState:
        """Return the debounced state of the switch."""
