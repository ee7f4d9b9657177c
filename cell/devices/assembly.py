"""Builds devices, clock and estimator from a CellConfig, opens the devices, and closes them in reverse order.

Only this module names hardware and simulated classes together; here the type checker proves that each satisfies its
protocol. Simulated classes are imported only if a config needs them.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from datetime import date
from functools import lru_cache
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Protocol

import numpy as np

from cell.config.cell_config import CellConfig
from cell.config.files import ERRORS_FILE, SHIPPED
from cell.devices.checks import LOOP_TIME, OK, check_clock, hand_verdicts, loop_verdict, remedy, verdict
from drivers import impedance
from drivers.arm.calibration import ArmCalibration, read_arm_calibration
from drivers.arm.franka import FrankaArm
from drivers.arm.franka_config import FrankaArmConfig
from drivers.arm.loop_figures import LoopFigures
from drivers.arm.model import ArmModel
from drivers.clock import WallClock
from drivers.errors import CellError, ConfigError
from drivers.gripper.franka import FrankaGripper
from drivers.gripper.franka_config import FrankaGripperConfig
from drivers.parts import Job
from drivers.protocols import Arm, Clock, Device, Gripper, Skin, SuccessSwitch
from drivers.quantities import Pose, Vector
from drivers.scene_facts import Sight
from drivers.skin.board_config import EMULATED, CanSkinConfig, HostSkinConfig, SerialSkinConfig
from drivers.skin.boards import CanSkin, HostSkin, SerialSkin
from drivers.skin.calibration import CalibratedSkin, SkinCalibration, read_calibration
from drivers.skin.figures import SkinFigures
from drivers.skin.layout import Layout
from drivers.skin.recording import RecordedSkin
from drivers.switch.absent import AbsentSwitch, NoSwitchConfig
from drivers.switch.board import SerialSuccessSwitch
from drivers.switch.board_config import SerialSwitchConfig
from drivers.switch.wire import BAUD_RATE
from drivers.transport.serial_line import SerialLine
from drivers.transport.traffic import PlaybackCan, PlaybackLine, RecordedWire, Recorder, is_traffic
from drivers.transport.wires import ByteLink, CanLink
from skills.catalogue import INSERT, RECOVER
from skills.contract import Devices, Perception, SkillContext
from skills.guards.scan_guards import ScanSchedule
from skills.guards.setpoint_bounds import ArmBounds
from skills.guards.setpoint_gate import GatedArm
from skills.guards.wrench_zero import ZeroedWrench
from skills.tactile.blend import Blend
from skills.tactile.estimators import ESTIMATORS, TouchSetup
from skills.tactile.pose import Estimator, Tracker

if TYPE_CHECKING:
    from sim.boards.board_links import EmulatedCan, EmulatedLine
    from sim.boards.emulated import SkinSource
    from sim.hand.bench import CalibrationBench
    from sim.hand.switch import SwitchSource
    from sim.world.reality import Drawn
    from sim.world.truth import Truth

SCAN_STREAM = 5
"""Key of the random stream for late scans."""
SEARCH_STREAM = 3
"""Key of the random stream for choices of the skills; the simulated world uses the lower keys."""


def _nothing() -> None:
    """Do nothing: in a real cell, people and machines do this work."""


class Pluggable(Protocol):
    """A simulated device with a cable that can be unplugged."""

    is_unplugged: bool
    """True if the cable is unplugged."""


@dataclass(frozen=True, slots=True)
class Cell:
    """The parts of one cell, ready to be opened."""

    config: CellConfig
    clock: Clock
    arm: Arm
    gripper: Gripper
    skin: Skin
    switch: SuccessSwitch
    restock: Callable[[Job, int], None]
    """Function of a job and a run's seed that sets up workpiece and pegs; on hardware the line sets them up."""
    exchange: Callable[[], None] = _nothing
    """Function that removes the workpiece with the seated peg; on hardware the line removes it."""
    refill: Callable[[], None] = _nothing
    """Function that fills the rack; on hardware it does nothing, because a person fills the rack before reporting it."""
    empty: Callable[[], None] = _nothing
    """Function that takes all pegs out of the rack until `refill`; on hardware it does nothing."""
    clear: Callable[[], None] = _nothing
    """Function that removes the peg from any place; on hardware it does nothing: a person removes the peg before reporting it."""
    errors: Mapping[str, str] = field(default_factory=dict)
    """Errors drawn for a simulated cell, by name, for records."""
    truth: "Callable[[], Truth] | None" = None
    """Function that returns the true state, which no sensor measures; None on hardware."""
    pivot: Callable[[], tuple[float, Vector]] | None = None
    """Function that returns the true in-hand angle, rad, and tip, m, base frame, for every scan; None on hardware."""
    sight: Callable[[], Sight] | None = None
    """Function that returns the true poses of peg and hole, for pictures of a run; None on hardware."""
    arm_calibration: ArmCalibration | None = None
    """Calibration with which the arm's control law starts; None if the config names none."""
    commissioning: str = ""
    """Reason in words why only a person at the cell may start motions; empty if the PLC may."""
    boards: tuple[Device, ...] = ()
    """Emulated boards that are powered before the devices are opened."""
    skin_wire: "EmulatedCan | EmulatedLine | None" = None
    """Emulated wire of the skin, with replaceable faults; None if there is none."""
    skin_figures: Callable[[], SkinFigures] | None = None
    """Function that returns the reception figures of the skin; None for a simulated skin without a wire."""
    cables: Mapping[str, Pluggable] = field(default_factory=dict)
    """Simulated devices, by name, with cables that can be unplugged in a rehearsal; empty on hardware."""

    def devices(self, only: Sequence[str] = ()) -> list[tuple[str, Arm | Gripper | Skin | SuccessSwitch]]:
        """Return the devices by name, in opening order: all, or those named."""
        every = (("arm", self.arm), ("gripper", self.gripper), ("skin", self.skin), ("switch", self.switch))
        return [(name, device) for name, device in every if not only or name in only]

    def context(self, seed: int) -> SkillContext:
        """Return a skill's context; `seed` is the seed of the skills' random choices."""
        config = self.config
        return SkillContext(
            devices=Devices(
                self.clock,
                GatedArm(self.arm, bounds_of(config.arm_model()), config.limits),
                self.gripper,
                self.skin,
                config.skin.layout,
                self.switch,
            ),
            perception=make_perception(config),
            job=config.job(),
            limits=config.limits,
            schedule=ScanSchedule(1.0 / config.scan_rate, config.scan),
            rng=choices(seed),
            wrench=ZeroedWrench(config.wrench),
        )


def bounds_of(arm: ArmModel) -> ArmBounds:
    """Return the bounds of an arm's setpoints, from its file of figures."""
    joints = arm.joints
    return ArmBounds(
        speed=arm.tool_speed,
        turn_speed=arm.tool_turn_speed,
        stiffness=arm.stiffness,
        turn_stiffness=arm.turn_stiffness,
        torques=joints.torque,
        torque_rate=min(joints.torque_rate),
        q_min=joints.q_min,
        q_max=joints.q_max,
        joint_speeds=joints.speed,
    )


def choices(seed: int) -> np.random.Generator:
    """Return the random generator of the skills' choices in a run with this seed."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(SEARCH_STREAM,)))


def make_estimator(config: CellConfig) -> Estimator:
    """Return the estimator named by `insert.estimator`."""
    entry, path = ESTIMATORS[config.params(INSERT).estimator], config.calibration.skin
    measured = None if path is None else _calibration(path, config.skin.layout).point_spread
    return entry.make(config.estimator_params(entry), TouchSetup(config.skin.layout, config.peg, measured))


@lru_cache(maxsize=8)
def _calibration(path: Path, layout: Layout) -> SkinCalibration:
    """Return the content of a calibration file; it is read once per process, so that gains and point spread match."""
    return read_calibration(path, layout)


def make_tracker(config: CellConfig) -> Tracker:
    """Return the tracker that filters theta from frame to frame."""
    return Blend(config.smoothing)


def make_perception(config: CellConfig) -> Perception:
    """Return the estimator and the tracker of a run."""
    return Perception(make_estimator(config), make_tracker(config))


def assemble(config: CellConfig) -> Cell:
    """Return the cell of a config, not yet opened.

    Raises:
        ConfigError: A file named by the config is wrong, too old, or of another device.
    """
    calibration = _arm_calibration(config, date.today())
    if isinstance(config.arm, FrankaArmConfig):
        return _hardware(config, config.arm, calibration)
    from sim.arm.device import SimArm
    from sim.boards.busy_clock import BusyClock
    from sim.hand.gripper import SimGripper
    from sim.world.line import SimLine
    from sim.world.physics import World
    from sim.world.reality import Errors, recorded
    from sim.world.reality import read as read_errors

    assert config.sim is not None
    assert config.contact is not None
    assert config.grip is not None
    reality = read_errors(config.reality.file or SHIPPED / ERRORS_FILE).changed(config.reality.errors)
    errors = Errors(reality, config.reality, config.skin.layout)
    job = config.job()
    world = World(config.arm_model(), config.sim, config.contact, config.grip, config.skin.layout, job, errors)
    felt = _world_skin(config, world, world.draw.skin, world.drawn)
    switch, clock, boards, lever = _switch(config, world, felt.clock)
    if world.drawn["scan.late"] > 0.0:
        stream = np.random.SeedSequence(config.sim.seed, spawn_key=(SCAN_STREAM,))
        clock = BusyClock(clock, world.drawn, np.random.default_rng(stream))
    line = SimLine(world, clock, config.params(RECOVER).bin)
    return Cell(
        config=config,
        clock=clock,
        arm=SimArm(world, _law(config, calibration)),
        gripper=SimGripper(world),
        skin=_calibrated(config, felt.skin),
        switch=switch,
        arm_calibration=calibration,
        restock=line.stock,
        exchange=line.exchange,
        refill=line.refill,
        empty=line.empty,
        clear=line.clear,
        errors=recorded(world.drawn),
        truth=world.truth,
        pivot=world.pivot,
        sight=lambda: Sight(world.peg_pose(), Pose(world.plate.position, world.plate.rotation)),
        boards=boards,
        skin_wire=felt.wire,
        skin_figures=felt.figures,
        cables={name: device for name, device in (("skin", felt.cable), ("switch", lever)) if device is not None},
    )


def _arm_calibration(config: CellConfig, today: date) -> ArmCalibration | None:
    """Return the arm's calibration, if the config names one; require that no calibration is too old.

    Raises:
        ConfigError: A file cannot be used; one line with the file, the value found and the permitted values.
    """
    files = config.calibration
    if files.skin is not None:
        _require_age(files.skin, _calibration(files.skin, config.skin.layout).date, files.longest_age, today)
    if files.arm is None:
        return None
    found = read_arm_calibration(files.arm, config.arm_model(), config.arm_unit())
    _require_age(files.arm, found.date, files.longest_age, today)
    return found


def _require_age(path: Path, measured: date, longest: float, today: date) -> None:
    age = (today - measured).days
    if not 0 <= age <= longest / 86400.0:
        raise ConfigError(
            f"{path}: measured on {measured}, {age} days ago; 0 to {longest / 86400.0:g} days of calibration.longest_age"
            " allowed: calibrate again, or check the computer's date"
        )


def _law(config: CellConfig, calibration: ArmCalibration | None) -> Vector:
    """Return the initial state of the arm's law."""
    arm = config.arm_model()
    return impedance.new_state(arm, None if calibration is None else calibration.believed(arm))


def _hardware(config: CellConfig, arm: FrankaArmConfig, calibration: ArmCalibration | None) -> Cell:
    """Return a cell with a real arm; all other devices are then real too."""
    assert isinstance(config.gripper, FrankaGripperConfig)
    assert isinstance(config.switch, SerialSwitchConfig | NoSwitchConfig)
    clock = WallClock()
    felt = real_skin(config, clock)
    return Cell(
        config=config,
        clock=clock,
        arm=FrankaArm(arm, config.arm_model(), clock, _law(config, calibration)),
        arm_calibration=calibration,
        gripper=FrankaGripper(config.gripper, config.arm_model().hand.stroke),
        skin=_calibrated(config, felt.skin),
        switch=AbsentSwitch() if isinstance(config.switch, NoSwitchConfig) else _serial_switch(config.switch, clock),
        restock=lambda job, seed: None,
        skin_figures=felt.figures,
    )


@dataclass(frozen=True, slots=True)
class SkinLine:
    """A skin without calibration, with its wire."""

    skin: Skin
    clock: Clock
    """The cell's clock; an emulated board runs on it too."""
    figures: Callable[[], SkinFigures] | None
    """Function that returns the reception figures of the skin; None without a wire."""
    wire: "EmulatedCan | EmulatedLine | None" = None
    """Emulated wire, with replaceable faults; None if there is none."""
    cable: Pluggable | None = None
    """Device whose cable can be unplugged; None for a real board."""


def _calibrated(config: CellConfig, skin: Skin) -> Skin:
    if config.calibration.skin is None:
        return skin
    return CalibratedSkin(skin, _calibration(config.calibration.skin, config.skin.layout))


def real_skin(config: CellConfig, clock: Clock | None = None) -> SkinLine:
    """Return the skin of a real board, without calibration, by default on wall time."""
    skin, clock = config.skin, clock or WallClock()
    if isinstance(skin, CanSkinConfig):
        from drivers.transport.can_bus import CanBus

        return _can_skin(skin, CanBus(skin.interface, skin.channel, skin.bitrate), clock)
    if isinstance(skin, HostSkinConfig):
        host = HostSkin(skin, clock)
        return SkinLine(host, clock, host.figures)
    assert isinstance(skin, SerialSkinConfig)
    return _serial_skin(skin, SerialLine(skin.port, skin.baud_rate), clock)


def _can_skin(config: CanSkinConfig, bus: CanLink, clock: Clock) -> SkinLine:
    if not config.record:
        skin = CanSkin(config, bus, clock)
    else:
        recorder = Recorder(Path(config.record), "can", clock)
        skin = CanSkin(config, RecordedWire(bus, recorder), recorder)
    return SkinLine(skin, clock, skin.figures)


def _serial_skin(config: SerialSkinConfig, line: ByteLink, clock: Clock) -> SkinLine:
    if not config.record:
        skin = SerialSkin(config, line, clock)
    else:
        recorder = Recorder(Path(config.record), "serial", clock)
        skin = SerialSkin(config, RecordedWire(line, recorder), recorder)
    return SkinLine(skin, clock, skin.figures)


def _world_skin(
    config: CellConfig, source: "SkinSource", rng: np.random.Generator, drawn: "Drawn | None" = None
) -> SkinLine:
    """Return the skin of a simulated world: a simulated skin, or the driver of an emulated or a real board."""
    skin, model, seed = config.skin, config.boards.skin, config.first_seed
    if isinstance(skin, CanSkinConfig) and skin.channel == EMULATED:
        from sim.boards.board_clock import BoardClock
        from sim.boards.board_links import emulated_can

        bus = emulated_can(skin, model, source, rng, seed)
        return replace(_can_skin(skin, bus, BoardClock(source, (bus,))), wire=bus, cable=bus)
    if isinstance(skin, SerialSkinConfig) and skin.port == EMULATED:
        from sim.boards.board_clock import BoardClock
        from sim.boards.board_links import emulated_line

        line = emulated_line(skin, model, source, rng, seed)
        return replace(_serial_skin(skin, line, BoardClock(source, (line,))), wire=line, cable=line)
    if isinstance(skin, CanSkinConfig | SerialSkinConfig | HostSkinConfig):
        return real_skin(config, source)
    from sim.hand.skin import SimSkin, skin_truth
    from sim.world.reality import as_believed

    made = SimSkin(skin, source, rng, truth=skin_truth(drawn or as_believed(skin.layout), skin.layout))
    return SkinLine(made, source, None, cable=made)


def played_skin(config: CellConfig, path: Path, clock: Clock) -> SkinLine:
    """Return a skin played from a file: recorded traffic, on the playback's own clock, or a text file, on `clock`.

    Raises:
        ConfigError: The file is not a recording, or its wire differs from `skin.kind`.
    """
    skin = config.skin
    if not is_traffic(path):
        return SkinLine(RecordedSkin(path, clock), clock, None)
    if isinstance(skin, CanSkinConfig):
        bus = PlaybackCan(path)
        _require_wire(path, bus.wire, "can")
        played: CanSkin | SerialSkin = CanSkin(skin, bus, bus)
        return SkinLine(played, bus, played.figures)
    if isinstance(skin, SerialSkinConfig):
        line = PlaybackLine(path, 10.0 / skin.baud_rate)
        _require_wire(path, line.wire, "serial")
        played = SerialSkin(skin, line, line)
        return SkinLine(played, line, played.figures)
    raise ConfigError(f'{path}: traffic of a board; skin.kind = "can" or "serial" needed, not "{skin.kind}"')


def _require_wire(path: Path, found: str, wanted: str) -> None:
    if found != wanted:
        raise ConfigError(f'{path}: traffic of a wire of kind "{found}"; skin.kind = "{wanted}"')


def bench_skin(config: CellConfig, rod_half: float) -> "tuple[Skin, Clock, CalibrationBench]":
    """Return the cell's skin, its clock, and a bench with a rod as thick as the peg, half length `rod_half`, m.

    Raises:
        ConfigError: The skin is not simulated.
    """
    from sim.hand.bench import CalibrationBench
    from sim.world.disturb import draw

    if (
        not config.is_simulated
        or config.sim is None
        or config.contact is None
        or config.grip is None
        or not config.is_skin_simulated()
    ):
        raise ConfigError("a bench needs a simulated skin or an emulated board")
    bench = CalibrationBench(config.peg.part.thickness, rod_half)
    drawn = draw(config.arm_model(), config.job(), config.contact, config.grip, config.sim.seed)
    felt = _world_skin(config, bench, drawn.skin)
    return felt.skin, felt.clock, bench


def _switch(
    config: CellConfig, source: "SwitchSource", clock: Clock
) -> tuple[SuccessSwitch, Clock, tuple[Device, ...], Pluggable | None]:
    """Return the switch, the cell's clock, the emulated boards, and the device with the cable; an emulated board runs on that clock."""
    wired = config.switch
    if isinstance(wired, NoSwitchConfig):
        return AbsentSwitch(), clock, (), None
    if not isinstance(wired, SerialSwitchConfig):
        from sim.hand.switch import SimSwitch

        made = SimSwitch(source)
        return made, clock, (), made
    if wired.port != EMULATED:
        return _serial_switch(wired, clock), clock, (), None
    from sim.boards.board_clock import BoardClock
    from sim.boards.switch_board import EmulatedSwitchBoard

    board = EmulatedSwitchBoard(source, faults=config.boards.switch.faults, seed=config.first_seed)
    clock = BoardClock(clock, (board,))
    return _serial_switch(wired.model_copy(update={"port": board.port}), clock), clock, (board,), board


def _serial_switch(config: SerialSwitchConfig, clock: Clock) -> SerialSuccessSwitch:
    if not config.record:
        return SerialSuccessSwitch(config, clock)
    recorder = Recorder(Path(config.record), "serial", clock)
    return SerialSuccessSwitch(config, recorder, RecordedWire(SerialLine(config.port, BAUD_RATE), recorder))


@contextmanager
def _powered(cell: Cell) -> Iterator[ExitStack]:
    """Power the emulated boards; yield the stack that closes them after everything that is added to it."""
    with ExitStack() as stack:
        for board in cell.boards:
            stack.callback(board.close)
            board.open()
        yield stack


@contextmanager
def opened(cell: Cell, *only: str) -> Iterator[Cell]:
    """Open every device, or those named; at the end halt the arm and close the devices in reverse order.

    Raises:
        CellError: A device cannot be opened; those opened before it are closed again.
    """
    with _powered(cell) as stack:
        for name, device in cell.devices(only):
            stack.callback(device.close)
            device.open()
            if name == "arm":
                stack.callback(cell.arm.halt)
        yield cell


def check(cell: Cell, only: Sequence[str] = ()) -> list[tuple[str, str]]:
    """Open each device, or those named `only`, read it once and close it; return the name of each with "ok" or its fault.

    Raises:
        DeviceNotOpenedError: An emulated board cannot be powered.
    """
    with _powered(cell):
        found = _check_devices(cell, only)
    if isinstance(cell.clock, WallClock) and not only:
        found.append(("clock", check_clock(cell.clock, 1.0 / cell.config.scan_rate)))
    return found


def loop_figures(config: CellConfig, seconds: float, stop: Event) -> LoopFigures:
    """Open a physical arm, hold it still for `seconds` or until `stop`, and return the figures of its loop.

    Raises:
        CellError: The arm cannot be opened, times out or is stopped.
    """
    with opened(assemble(config), "arm") as cell:
        assert isinstance(cell.arm, FrankaArm)
        end = cell.clock.now() + seconds
        while cell.clock.now() < end and not stop.is_set():
            cell.clock.wait_until(cell.clock.now() + LOOP_TIME)
        cell.arm.read()
        return cell.arm.figures()


def _franka_facts(cell: Cell, arm: FrankaArm) -> list[tuple[str, str]]:
    """Return the verdicts on an opened arm: its loop, thresholds, end effector and load."""
    cell.clock.wait_until(cell.clock.now() + LOOP_TIME)
    figures, force = arm.figures(), float(np.linalg.norm(arm.read().wrench.force))
    config, hand = cell.config.arm, cell.config.arm_model().hand
    assert isinstance(config, FrankaArmConfig)
    return [
        ("arm", loop_verdict(figures)),
        # The library exposes no version of the arm's system: it refuses to connect to one with another interface.
        ("system", f"{OK}, with the interface that pylibfranka needs"),
        ("thresholds", f"{OK}, {config.collision_torque:g} N·m and {config.collision_force:g} N accepted by the arm"),
        *hand_verdicts(figures, hand, force, cell.config.wrench.offset),
    ]


def _check_devices(cell: Cell, only: Sequence[str]) -> list[tuple[str, str]]:
    found = []
    for name, device in cell.devices(only):
        try:
            device.open()
            told = verdict(device.read(), cell.config.skin.layout)
            if isinstance(device, FrankaArm):
                found += _franka_facts(cell, device)
            else:
                found.append((name, told))
        except CellError as error:
            found.append((name, remedy(error)))
        finally:
            device.close()
    return found
