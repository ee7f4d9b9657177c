"""Faults: the codes that the PLC reads, their meanings, and the exceptions that carry them."""

from dataclasses import dataclass
from enum import IntEnum


class FaultCode(IntEnum):
    """Number of a fault for the PLC: 1xxx communication, 2xxx motion, 3xxx interaction, 4xxx software; never reused."""

    NONE = 0
    SKIN_SILENT = 1001
    SKIN_UNTRUSTED = 1002
    SWITCH_UNKNOWN = 1003
    ARM_SILENT = 1004
    GRIPPER_SILENT = 1005
    PLC_LOST = 1006
    DEVICE_NOT_OPENED = 1007
    NOT_FINITE = 1008
    ARM_STOPPED = 2001
    ARM_REFLEX = 2002
    TRACKING = 2003
    NOT_PASSIVE = 2004
    SETPOINT = 2005
    ARM_RESTLESS = 2006
    SWITCH_DISAGREES = 3001
    SUCCESS_UNPROVEN = 3002
    WRENCH_OFFSET = 3003
    WRENCH_REVERSED = 3004
    SIMULATION_UNSTABLE = 4001
    SCAN_OVERRUN = 4002
    SOFTWARE = 4003
    CONFIG = 4004
    JOURNAL = 4005


@dataclass(frozen=True, slots=True)
class FaultText:
    """Meaning of one fault code, and the technician's remedy."""

    meaning: str
    cause: str
    remedy: str
    """Action before the reset, which every fault requires."""


FAULTS: dict[FaultCode, FaultText] = {
    FaultCode.NONE: FaultText("no fault", "-", "-"),
    FaultCode.SKIN_SILENT: FaultText(
        "no taxel frame arrived in time",
        "skin board unplugged, unpowered or its bus is down",
        "check the board's supply and cable",
    ),
    FaultCode.SKIN_UNTRUSTED: FaultText(
        "too few taxels can be trusted, or the skin shows no print of the peg that the hand holds",
        "dead, saturated, frozen, stuck, swapped or random modules",
        "run `cell check`, change the finger it names",
    ),
    FaultCode.SWITCH_UNKNOWN: FaultText(
        "the success switch gives no valid answer",
        "cable, supply or firmware of the switch board",
        "run `cell check`, mend the switch",
    ),
    FaultCode.ARM_SILENT: FaultText(
        "the arm's state is too old, or its readings stand still while it follows a setpoint",
        "network to the robot controller, or the controller itself",
        "check the cable and the controller",
    ),
    FaultCode.GRIPPER_SILENT: FaultText(
        "the gripper does not answer", "gripper cable or its controller", "check the gripper"
    ),
    FaultCode.PLC_LOST: FaultText(
        "the PLC's life counter stands still, or its heartbeat has ended",
        "PLC stopped or network down",
        "bring the PLC back; it must send its command again",
    ),
    FaultCode.DEVICE_NOT_OPENED: FaultText(
        "a device could not be opened",
        "wrong port, no permission, or used by another program",
        "run `cell check` and do what it says",
    ),
    FaultCode.NOT_FINITE: FaultText(
        "a reading is not a number, or is outside its sensor's range",
        "a defect in the driver, the firmware or the estimator that the message names",
        "keep the log and the run's record, report it",
    ),
    FaultCode.ARM_STOPPED: FaultText(
        "the arm is in emergency or protective stop",
        "somebody pressed a stop, or the arm's own supervision did",
        "find out why, release the stop",
    ),
    FaultCode.ARM_REFLEX: FaultText(
        "the arm stopped itself by reflex",
        "collision, or a torque, speed or joint limit",
        "look at the run's record, clear the way",
    ),
    FaultCode.TRACKING: FaultText(
        "the arm is too far from its setpoint",
        "it is blocked, or the setpoint cannot be reached",
        "clear the way, check the poses in the config",
    ),
    FaultCode.NOT_PASSIVE: FaultText(
        "the held setpoint pumps energy into the arm",
        "gains too high for the age of the skin's frames",
        "lower the gains or raise their damping, see `cell study stability`",
    ),
    FaultCode.SETPOINT: FaultText(
        "a skill requested a motion that the arm must not make",
        "a defect in the skill, or a place in the config that is outside the workspace",
        "check what the message names against [limits] and the places in the config",
    ),
    FaultCode.ARM_RESTLESS: FaultText(
        "the arm continues to move after a halt",
        "its controller does not obey, its model of gravity is wrong, or something moves it",
        "press the emergency stop if it still moves; check payload and controller",
    ),
    FaultCode.SUCCESS_UNPROVEN: FaultText(
        "the skills report success, but the evidence is missing",
        "a stuck switch, a hand that did not open, a peg that came along, or a defect in a skill",
        "look at the part, the hand and the switch, clear the part",
    ),
    FaultCode.SWITCH_DISAGREES: FaultText(
        "the switch and the depth of the tip disagree",
        "stuck switch, wrong hole depth in the recipe, or a wrong part",
        "look at the part and the switch",
    ),
    FaultCode.WRENCH_OFFSET: FaultText(
        "the force that the arm reports where nothing touches is implausible",
        "something touches hand or peg, or the payload in the arm's controller is wrong",
        "free the hand; set the payload of hand and peg in Desk, step 4 of docs/first-day.md",
    ),
    FaultCode.WRENCH_REVERSED: FaultText(
        "the arm reports a force along its push where the plate bears the push",
        "the arm's software reports its external wrench with another sign than its driver expects",
        "stop using this arm, as step 8 of docs/first-day.md says; report the versions of its software and of the driver",
    ),
    FaultCode.SIMULATION_UNSTABLE: FaultText(
        "the simulated physics diverged",
        "time step or gains outside the stable range",
        "reduce sim.timestep or the gains",
    ),
    FaultCode.SCAN_OVERRUN: FaultText(
        "the scan missed its period too often, or a skill blocked it",
        "the computer is too slow or too busy, or the skill that the message names computes or waits too long",
        "stop other programs or lower scan_rate; mend the skill that is named",
    ),
    FaultCode.SOFTWARE: FaultText(
        "an error inside this program", "a defect", "keep the log and the run's record, report it"
    ),
    FaultCode.CONFIG: FaultText(
        "the configuration cannot be used",
        "a key, value or file named in the message",
        "correct what the message names",
    ),
    FaultCode.JOURNAL: FaultText(
        "the records cannot be opened; later a record that cannot be written is a warning and no fault",
        "no permission, a disk that is read-only, or an index of a newer version",
        "correct the folder or name another, then start again",
    ),
}


class NotCalibratedError(Exception):
    """A calibration ended without figures, although nothing is broken; the message gives the reason."""


class CellError(Exception):
    """A fault: something is broken, and `code` is the number that the PLC reads.

    The message names the thing, the value, the limit and the permitted choices, in one line.
    """

    code = FaultCode.SOFTWARE

    def __init_subclass__(cls, code: FaultCode | None = None) -> None:
        """Set the fault code of a class; without `code`, the class keeps the code of its base class."""
        if code is not None:
            cls.code = code


class SkinSilentError(CellError, code=FaultCode.SKIN_SILENT):
    """No taxel frame arrived within the configured time."""


class SkinUntrustedError(CellError, code=FaultCode.SKIN_UNTRUSTED):
    """Too few taxels can be trusted to estimate the pose of the peg."""


class SwitchUnknownError(CellError, code=FaultCode.SWITCH_UNKNOWN):
    """The switch under the hole returns no valid answer."""


class SwitchDisagreesError(CellError, code=FaultCode.SWITCH_DISAGREES):
    """The switch and the depth of the tip contradict each other."""


class ArmSilentError(CellError, code=FaultCode.ARM_SILENT):
    """The arm's state is too old, or its connection is gone."""


class GripperSilentError(CellError, code=FaultCode.GRIPPER_SILENT):
    """The gripper does not answer, or refuses a command."""


class ArmStoppedError(CellError, code=FaultCode.ARM_STOPPED):
    """An emergency or protective stop holds the arm."""


class ArmReflexError(CellError, code=FaultCode.ARM_REFLEX):
    """The arm's controller stopped the arm by a reflex."""


class TrackingError(CellError, code=FaultCode.TRACKING):
    """The arm is too far from its setpoint."""


class NotPassiveError(CellError, code=FaultCode.NOT_PASSIVE):
    """The held setpoint puts more energy into the arm than a stable loop can."""


class ArmRestlessError(CellError, code=FaultCode.ARM_RESTLESS):
    """The arm still moves long after it was halted."""


class SetpointError(CellError, code=FaultCode.SETPOINT):
    """A skill requested a setpoint that is not finite, lies outside the workspace, or is too far away or too fast."""


class NotFiniteError(CellError, code=FaultCode.NOT_FINITE):
    """A reading of a device, or a quantity computed from it, is not finite."""


class SuccessUnprovenError(CellError, code=FaultCode.SUCCESS_UNPROVEN):
    """The skills report success without evidence."""


class WrenchOffsetError(CellError, code=FaultCode.WRENCH_OFFSET):
    """The external wrench that the arm reports in free air is implausible."""


class WrenchReversedError(CellError, code=FaultCode.WRENCH_REVERSED):
    """The external wrench that the arm reports points along the push on a surface instead of against it."""


class PlcLostError(CellError, code=FaultCode.PLC_LOST):
    """The PLC's life counter stands still, or its heartbeat has ended."""


class DeviceNotOpenedError(CellError, code=FaultCode.DEVICE_NOT_OPENED):
    """A device could not be opened."""


class SimulationUnstableError(CellError, code=FaultCode.SIMULATION_UNSTABLE):
    """The simulated physics diverged."""


class ScanOverrunError(CellError, code=FaultCode.SCAN_OVERRUN):
    """The scan missed its period too often."""


class ConfigError(CellError, code=FaultCode.CONFIG):
    """The configuration cannot be used; the message names file, key, value and the permitted values."""


class JournalError(CellError, code=FaultCode.JOURNAL):
    """The run's record cannot be written or read."""


class UnknownRunError(ConfigError, JournalError):
    """A command names a run that is not on record: wrong use, not a fault of the journal."""
