"""Instant, scripted stand-ins without physics: devices that execute commands at once, and a PLC that acts on cue."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import ClassVar

import numpy as np

from cell.config.cell_config import CellConfig
from cell.config.load import LoadedConfig
from cell.config.parameters import PARAMETERS
from cell.devices.assembly import Cell
from cell.records.journal import Journal
from cell.run.line import PROGRAMS
from cell.run.supervisor import Supervisor
from drivers.errors import SkinSilentError
from drivers.frames import peg_in_finger
from drivers.parts import Job
from drivers.quantities import ArmState, GripperState, ImpedanceSetpoint, Pose, SwitchState, TaxelFrame, Wrench
from drivers.skin.layout import shape_of
from plc_bridge.bridge import Bridge
from plc_bridge.protocol.images import CommandImage
from plc_bridge.protocol.messages import Report
from skills.catalogue import RECOVER
from skills.contract import Devices, Perception, SkillContext
from skills.guards.scan_guards import ScanLimits, ScanSchedule
from skills.tactile.blend import Blend, Smoothing
from skills.tactile.pose import PegPose
from tests.pegs import LOAD, readings

HAND_DOWN = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
"""The finger frame of a hand that points down, closing along y."""


class FakeClock:
    """Clock whose time passes only during waits; actions that become due are then executed."""

    def __init__(self) -> None:
        self.time = 0.0
        self.lag = 0.0
        """Time by which every wait takes longer, as on a busy computer, s."""
        self.at: list[tuple[float, Callable[[], None]]] = []
        self.every: list[Callable[[], None]] = []

    def now(self) -> float:
        return self.time

    def wait_until(self, stamp: float) -> None:
        self.time = max(self.time, stamp) + self.lag
        for action in self.every:
            action()
        due = [entry for entry in self.at if entry[0] <= self.time]
        for entry in due:
            self.at.remove(entry)
            entry[1]()


class FakeArm:
    """Is at once where it shall be, but never with the controlled point below `floor`."""

    def __init__(self, clock: FakeClock) -> None:
        self.clock = clock
        self.tcp = Pose(np.array([0.45, 0.0, 0.3]), HAND_DOWN)
        self.force = np.zeros(3)
        self.q, self.dq = np.zeros(7), np.zeros(7)
        self.floor = -math.inf
        self.fault: Exception | None = None
        self.is_blocked = False
        self.is_frozen = False
        """True if the readings have no noise."""
        self.is_open = self.is_halted = False
        self.handed, self.valid_until = -math.inf, -math.inf
        self.resets = 0

    def open(self) -> None:
        self.is_open = True

    def close(self) -> None:
        self.is_open = False

    def follow(self, setpoint: ImpedanceSetpoint) -> None:
        self.is_halted = False
        self.handed, self.valid_until = self.clock.now(), setpoint.valid_until
        if self.is_blocked:
            return
        theta, length = (0.0, 0.0) if setpoint.in_hand is None else (setpoint.in_hand.theta, setpoint.in_hand.length)
        roll = self.tcp.rotation[:, 2] if setpoint.roll is None else setpoint.roll
        closing = roll - (roll @ setpoint.axis) * setpoint.axis
        closing /= np.linalg.norm(closing)
        peg = np.column_stack([closing, np.cross(setpoint.axis, closing), setpoint.axis])
        finger_peg = peg_in_finger(theta, length)
        rotation = peg @ finger_peg.rotation.T
        tip = np.array([*setpoint.tip[:2], max(setpoint.tip[2], self.floor)])
        self.tcp = Pose(tip - rotation @ finger_peg.position, rotation)

    def halt(self) -> None:
        self.is_halted = True
        self.handed = self.valid_until = -math.inf

    def reset(self) -> None:
        self.resets += 1
        self.fault = None

    def read(self) -> ArmState:
        if self.fault is not None:
            raise self.fault
        now = self.clock.now()
        age = now - self.handed if self.valid_until >= now else math.inf
        noise = 0.0 if self.is_frozen else 1e-12 * math.sin(1e3 * now)
        # A limit holds for the exact force: noise only takes away.
        wrench = Wrench(self.force * (1.0 - 1e-2 * abs(noise)), np.zeros(3))
        return ArmState(now, self.q.copy(), self.dq + noise, self.tcp, wrench, 2, age)


class FakeGripper:
    """Closes at once, on a peg or on nothing."""

    def __init__(self, width: float) -> None:
        self.peg_width = width
        self.has_peg = True
        self.fault: Exception | None = None
        self.force = 0.0
        self.width = 0.04

    def open(self) -> None: ...

    def close(self) -> None: ...

    def grip(self, force: float) -> None:
        self.force, self.width = force, self.peg_width if self.has_peg else 0.0

    def release(self, width: float) -> None:
        self.force, self.width = 0.0, width

    def read(self) -> GripperState:
        if self.fault is not None:
            raise self.fault
        return GripperState(self.width, self.force > 0.0 and self.has_peg, False)


@cache
def straight_print() -> np.ndarray:
    """Return what the taxels read of a straight peg, shape (2, 20), counts."""
    values: np.ndarray = readings("parallelogram", LOAD)
    return values


class FakeSkin:
    """Ten frames a second, with the print of a straight peg while the hand, if it knows one, holds a peg."""

    def __init__(self, clock: FakeClock, hand: "FakeGripper | None" = None) -> None:
        self.clock, self.hand = clock, hand
        self.shows_print = True
        self.fault: Exception | None = None
        self.is_unplugged = False
        self.trusted = np.ones(shape_of("parallelogram"), dtype=bool)
        self.reads = 0

    def open(self) -> None: ...

    def close(self) -> None: ...

    def read(self) -> TaxelFrame:
        self.reads += 1
        if self.fault is not None:
            raise self.fault
        if self.is_unplugged:
            raise SkinSilentError("skin: no frame")
        number = int(self.clock.now() * 10.0 + 1e-6)
        is_held = self.hand is not None and self.shows_print and self.hand.force > 0.0 and self.hand.has_peg
        values = straight_print().copy() if is_held else np.zeros(self.trusted.shape)
        return TaxelFrame(values, self.trusted.copy(), number / 10.0, number)


class FakeSwitch:
    """Reports the state that the test has set."""

    def __init__(self) -> None:
        self.state = SwitchState.OPEN

    def open(self) -> None: ...

    def close(self) -> None: ...

    def read(self) -> SwitchState:
        return self.state


class ToldEstimator:
    """Estimator that returns for each frame the pose that the test has set, and counts the frames."""

    def __init__(self) -> None:
        self.theta, self.is_healthy, self.frames = 0.0, True, 0

    def estimate(self, frame: TaxelFrame) -> PegPose:
        self.frames += 1
        return PegPose(self.theta, 0.0, 0.01, 0.0, self.is_healthy, frame.stamp)


PERIOD = 0.01
"""Period of the scan of a context of fakes, s."""


def context_of(config: CellConfig, arm: FakeArm, hand: FakeGripper) -> SkillContext:
    """Return what a skill runs in, of an arm and a hand that share the arm's clock."""
    return SkillContext(
        devices=Devices(arm.clock, arm, hand, FakeSkin(arm.clock, hand), "parallelogram", FakeSwitch()),
        perception=Perception(ToldEstimator(), Blend(Smoothing())),
        job=config.job(),
        limits=config.limits,
        schedule=ScanSchedule(PERIOD, ScanLimits()),
        rng=np.random.default_rng(1),
    )


class FakePlc:
    """A PLC behind the bridge's mailbox, without sockets; lives in the cell's own time."""

    def __init__(self, bridge: Bridge, clock: FakeClock) -> None:
        self._bridge = bridge
        self._image = CommandImage()
        self.is_alive = True
        bridge.opened("plc", "plc")
        self.live()
        clock.every.append(self.live)

    def live(self) -> None:
        """Count life up, as a PLC does in every cycle."""
        if self.is_alive:
            self._write(life=self._image.life % 0xFFFF + 1)

    def trigger(self, code: int, recipe: int = 0, parameters: tuple[tuple[int, int], ...] = ()) -> None:
        """Send a command under the next sequence number."""
        self._write(sequence=self._image.sequence + 1, code=code, recipe=recipe, parameters=parameters)

    def stop(self) -> None:
        """Set the stop coil for a moment."""
        self._bridge.switched("plc", {"stop": True})
        self._bridge.switched("plc", {"stop": False})

    def acknowledge(self) -> None:
        """Acknowledge the result."""
        self._write(acknowledge=self._image.sequence)

    @property
    def report(self) -> Report:
        """Report that the PLC reads now."""
        return self._bridge.report_for("plc")

    def _write(self, **changes: object) -> None:
        values = {name: getattr(self._image, name) for name in CommandImage.__slots__} | changes
        self._image = CommandImage(**values)  # type: ignore[arg-type]
        self._bridge.wrote("plc", self._image)


@dataclass
class Rig:
    """A whole cell of fakes, with a PLC; its journal is closed when the test is over."""

    made: ClassVar[list["Rig"]] = []
    """Cells of the test under way."""

    loaded: LoadedConfig
    folder: Path
    clock: FakeClock = field(default_factory=FakeClock)
    restocked: list[tuple[Job, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        config = self.loaded.cell
        self.arm, self.gripper = FakeArm(self.clock), FakeGripper(config.peg.part.thickness)
        self.skin, self.switch = FakeSkin(self.clock, self.gripper), FakeSwitch()
        self.cell = Cell(
            config, self.clock, self.arm, self.gripper, self.skin, self.switch, lambda *job: self.restocked.append(job)
        )
        self.journal = Journal(self.folder)
        self.bridge = Bridge(config.plc, PROGRAMS, PARAMETERS, now=self.clock.now)
        self.plc = FakePlc(self.bridge, self.clock)
        self.supervisor = Supervisor(self.cell, self.loaded, self.bridge, self.journal)
        self.journal.open()
        self.made.append(self)

    def scan(self, times: int = 3) -> Report:
        """Scan, outside a program so many times, and return what the PLC reads then."""
        for _ in range(times):
            self.supervisor.scan()
        return self.plc.report

    def at(self, delay: float, action: Callable[[], None]) -> None:
        """Do something when so much time has passed."""
        self.clock.at.append((self.clock.now() + delay, action))

    def command(self, code: int, recipe: int = 0, parameters: tuple[tuple[int, int], ...] = ()) -> Report:
        """Send a command, let the cell obey to the end, and return what the PLC reads then."""
        self.plc.trigger(code, recipe, parameters)
        return self.scan()

    def put_away(self) -> Report:
        """Let the cell take what its hand holds to the bin."""
        return self.command(RECOVER.code)
