"""Stability limits of the loop through the skin on the whole simulated arm, beside sampled-loop theory.

The hand takes a peg from the rack and holds it over the plate, tilted as in the search. The setpoint of its tip, or of
its axis, then steps aside, and the true motion is judged. Skin, estimator, the arm's law and the arm are those of every
trial. Without the observer, the error of [gibbons], Eq. (5), is held between frames. With it, the cell works as usual:
only theta is as old as the frame, with the configured smoothing, and x_p, v and J_p follow the joints at 1 kHz.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import numpy as np

from cell.config.cell_config import CellConfig
from cell.config.margins import HELD, loop_at, margins
from cell.config.sampled_loop import largest_factor
from cell.devices.assembly import Cell, assemble, opened
from cell.lab.workers import on_processes
from drivers import impedance
from drivers.arm.inertia import tip_inertia
from drivers.arm.model import JOINTS
from drivers.errors import CellError, SimulationUnstableError
from drivers.frames import angle_between, end_point, rotation_about, rotation_by
from drivers.quantities import ImpedanceSetpoint, InHandTip, Vector
from sim.situation import PegSituation
from sim.world import World
from skills import grasp_from_rack
from skills.catalogue import GRASP, INSERT, SEARCH
from skills.contract import Observation, Outcome, SkillContext
from skills.motion import Gains, Goal, move
from skills.passivity import PassivityGuard, PassivityVerdict
from skills.tactile.blend import Smoothing

HEIGHT = 0.1
"""Height of the tip above the hole, m, at which the arm moves freely."""
FORCE, TORQUE = 15.0, 1.5
"""Largest initial force, N, and torque, N·m, of a step; a quarter of the guard's stop limits."""
STEPS = {"translation": 0.01, "rotation": 0.1}
"""Largest steps of translation, m, and rotation, rad."""
DIRECTIONS = {"translation": np.array([0.8, 0.6, 0.0]), "rotation": np.array([0.6, 0.8, 0.0])}
"""Directions of the step, translation along and rotation about, shape (3,), base frame."""
LOST = 8.0
"""Distance from the setpoint, in largest steps, at which a motion ends as unstable."""
RESTLESS = 0.25
"""Standard deviation in the last quarter of a case, in largest steps, above which a motion is unstable; dry friction
causes less."""
PERIODS, LEAST_TIME = 30, 2.0
"""Duration of a case: number of frames, and shortest time, s."""


@dataclass(frozen=True, slots=True)
class Grid:
    """Cases of the map."""

    periods: tuple[float, ...]
    """Periods of the frames, s; multiples of the scan's."""
    delays: tuple[int, ...]
    """Ages of a frame at its first use, in frames."""
    gains: dict[str, tuple[float, ...]]
    """Gains of translation, N/m, and of rotation, N·m/rad."""


def _geometric(low: float, high: float, count: int) -> tuple[float, ...]:
    return tuple(float(x) for x in np.geomspace(low, high, count))


WHOLE = Grid(
    (0.02, 0.05, 0.1, 0.2),
    (0, 1, 2),
    {"translation": _geometric(100.0, 51200.0, 10), "rotation": _geometric(5.0, 2560.0, 10)},
)
QUICK = Grid((0.05, 0.1), (0, 1), {"translation": (400.0, 2500.0, 20e3), "rotation": (10.0, 300.0, 1000.0)})


@dataclass(frozen=True, slots=True)
class GridCase:
    """One point of the map."""

    kind: str
    """Kind of the step and of the varied gain: `translation` or `rotation`."""
    observer: bool
    period: float
    """Period of the frames, s."""
    delay: int
    """Age of a frame at its first use, in frames."""
    gain: float
    """Varied gain, N/m or N·m/rad."""


@dataclass(frozen=True, slots=True)
class StepTrace:
    """Result of one case."""

    case: GridCase
    is_stable: bool
    peak: float
    """Largest distance from the setpoint after the step, m or rad."""
    softened_at: float | None
    """Time after the step at which the guard would have softened the motion, s; NaN if never."""
    stopped_at: float | None
    """Time after the step at which the guard would have stopped the motion, s; NaN if never."""
    lost_at: float | None
    """Time after the step at which the motion ended as unstable, s; NaN if never."""


@dataclass(frozen=True, slots=True)
class Boundary:
    """Theoretical boundary, for the arm's own inertia at the pose of the map."""

    kind: str
    period: float
    delay: int
    gain: float
    """First unstable gain, with the damping ratio of the insertion's gains, N/m or N·m/rad."""


@dataclass(frozen=True, slots=True)
class Shipped:
    """One gain of the config, and its distance from the theoretical boundary."""

    skill: str
    kind: str
    period: float
    """Period of the skin's frames, s."""
    gain: float
    limit: float
    """First unstable gain, with unchanged damping ratio and the error as old as a frame used at once."""
    margin: float
    """Limit divided by gain."""


def shipped_margins(config: CellConfig) -> list[Shipped]:
    """Return the margins of every gain in the loop through the skin."""
    return [
        Shipped(key.removesuffix(".gains"), found.kind, 1.0 / config.skin.rate, found.gain, found.limit, found.factor)
        for key, gains in config.steered().items()
        for found in margins(gains, config.skin.rate, config.place())
    ]


def gains_of(base: Gains, kind: str, gain: float) -> tuple[Vector, Vector]:
    """Return stiffness and damping ratios, each shape (6,), with one gain set."""
    set_to = base.model_copy(update={kind: gain})
    return set_to.stiffness(), set_to.damping_ratios()


def boundaries(base: Gains, inertia: Vector, grid: Grid) -> list[Boundary]:
    """Return the theoretical boundary for every period and delay."""
    found = []
    for kind, period, delay in product(HELD, grid.periods, grid.delays):
        factor = largest_factor(partial(loop_at, kind, base, inertia), period, delay)
        found.append(Boundary(kind, period, delay, factor * getattr(base, kind)))
    return found


def measure(
    config: CellConfig, grid: Grid, workers: int, done: Callable[[int], None]
) -> tuple[list[StepTrace], Vector]:
    """Run the map.

    Args:
        config: A simulated cell.
        grid: Cases of the map.
        workers: Number of processes.
        done: Called with the number of further completed cases.

    Returns:
        Result of every case, and the arm's inertia at the tip, shape (6, 6).
    """
    columns = [
        [
            GridCase(kind, observer, period, delay, gain)
            for kind, delay in product(HELD, grid.delays)
            for gain in grid.gains[kind]
        ]
        for period, observer in product(sorted(grid.periods, reverse=True), (False, True))
    ]
    traces: list[StepTrace] = []
    inertia = np.zeros((6, 6))
    for column, found in on_processes(partial(_column, config, columns), range(len(columns)), workers):
        inertia = found
        traces += column
        done(len(column))
    return sorted(
        traces, key=lambda t: (t.case.kind, t.case.observer, t.case.delay, t.case.period, t.case.gain)
    ), inertia


def _column(config: CellConfig, columns: Sequence[Sequence[GridCase]], number: int) -> tuple[list[StepTrace], Vector]:
    """Run the cases of one column, with common period and observer; a cell that lost its peg is replaced."""
    traces: list[StepTrace] = []
    cases = columns[number]
    while len(traces) < len(cases):
        with _held_peg(config, cases[0]) as bench:
            while bench.is_usable and len(traces) < len(cases):
                traces.append(bench.run(cases[len(traces)]))
            inertia = bench.inertia
    return traces, inertia


@dataclass(slots=True)
class HeldPeg:
    """A cell whose hand holds a peg at rest over the plate."""

    cell: Cell
    world: World
    ctx: SkillContext
    base: Gains
    roll: Vector
    q: Vector
    """Joint positions of the model, including the peg's hinge."""
    is_sound: bool = True
    """True if the physics stayed finite."""

    @property
    def is_usable(self) -> bool:
        """True if another case can run."""
        return self.is_sound and self.world.truth().peg is PegSituation.HELD

    @property
    def inertia(self) -> Vector:
        """Inertia of the arm at the tip, shape (6, 6)."""
        return tip_inertia(self.world.arm, self.q[:JOINTS], self.length)

    @property
    def length(self) -> float:
        """Distance from the finger centre to the peg's end, m."""
        return self.cell.config.peg.length

    def run(self, case: GridCase) -> StepTrace:
        """Step the setpoint aside and return the result."""
        self._set_down()
        ctx, world = self.ctx, self.world
        theta = world.truth().theta
        limit = STEPS[case.kind]
        step = min(limit, (FORCE if case.kind == "translation" else TORQUE) / case.gain) * DIRECTIONS[case.kind]
        seen = ctx.observe()
        goal = _stepped(case.kind, seen.tip, seen.axis, step)
        truth = _stepped(case.kind, *end_point(world.tcp(), theta, self.length), step)
        stiffness, ratios = gains_of(self.base, case.kind, case.gain)
        plain = ImpedanceSetpoint(ctx.new_id(), *goal, stiffness, ratios, math.inf, ctx.in_hand(), self.roll)
        guard = PassivityGuard(ctx.limits.force)
        begin, away = world.now(), [0.0]
        verdicts: dict[PassivityVerdict, float] = {}
        frames: list[Observation] = []
        lasting = max(PERIODS * case.period, LEAST_TIME)
        commanded = plain
        while (elapsed := world.now() - begin) < lasting:
            seen = ctx.observe()
            if seen.is_new_frame or not frames:
                frames.append(seen)
                commanded = _with_frame(case, plain, frames)
            elif case.observer and case.delay == 0:
                # An observer can update theta at every scan.
                commanded = replace(plain, in_hand=ctx.in_hand())
            ctx.arm.follow(commanded)
            away.append(_distance(case.kind, end_point(seen.arm.tcp, theta, self.length), truth))
            verdicts.setdefault(guard.update(plain, seen.arm.tcp, seen.stamp), elapsed)
            if away[-1] > LOST * limit:
                break
            try:
                if case.observer:
                    world.wait_until(seen.stamp + ctx.scan_period)
                else:
                    self._hold_error(case, plain, commanded, frames)
            except SimulationUnstableError:
                away.append(math.inf)
                self.is_sound = False
                break
        lost = elapsed if away[-1] > LOST * limit else None
        swing = float(np.std(away[-len(away) // 4 :])) if lost is None else math.inf
        return StepTrace(
            case,
            lost is None and swing < RESTLESS * limit,
            max(away),
            verdicts.get(PassivityVerdict.SOFTEN),
            verdicts.get(PassivityVerdict.STOP),
            lost,
        )

    def _hold_error(
        self, case: GridCase, plain: ImpedanceSetpoint, commanded: ImpedanceSetpoint, frames: Sequence[Observation]
    ) -> None:
        """Advance by one scan with the error of a frame: the setpoint moves with the arm, in every control period."""
        ctx, world = self.ctx, self.world
        assert commanded.in_hand is not None
        used = _used(case, frames)
        error = np.concatenate([plain.tip - used.tip, _turn(used, plain)]) * (len(frames) > case.delay)
        end = world.now() + ctx.scan_period
        while world.now() < end - 1e-9:
            tcp = ctx.arm.read().tcp
            tip, axis = end_point(tcp, commanded.in_hand.theta, commanded.in_hand.length)
            if case.kind == "translation":
                ctx.arm.follow(replace(commanded, tip=tip + error[:3]))
            else:
                roll = float(error[3:] @ axis)
                swing, closing = error[3:] - roll * axis, tcp.rotation[:, 2]
                turned = (rotation_by(swing) @ axis, rotation_by(roll * axis) @ closing)
                ctx.arm.follow(replace(commanded, axis=turned[0], roll=turned[1]))
            world.wait_until(world.now() + world.arm.control_period)

    def _set_down(self) -> None:
        """Restore the positions of arm and peg, at rest, and let the skin read them."""
        _, data = self.world.physics()
        data.qpos[:], data.qvel[:] = self.q, 0.0
        self.world.control.law[:] = impedance.new_state(self.world.arm)
        self.ctx.arm.halt()
        self.world.wait_until(self.world.now() + 2.0 / self.cell.config.skin.rate)


def _used(case: GridCase, frames: Sequence[Observation]) -> Observation:
    """Return the frame in use when the newest one arrives; it is an older one if frames are late."""
    return frames[max(len(frames) - 1 - case.delay, 0)]


def _with_frame(case: GridCase, plain: ImpedanceSetpoint, frames: Sequence[Observation]) -> ImpedanceSetpoint:
    """Return the setpoint with theta from the frame in use."""
    used = _used(case, frames)
    assert plain.in_hand is not None
    return replace(plain, in_hand=InHandTip(used.peg.theta, plain.in_hand.length, used.peg.stamp))


def _turn(seen: Observation, plain: ImpedanceSetpoint) -> Vector:
    """Return the rotation from the peg's measured attitude to its setpoint, as in the law, shape (3,), rad."""
    v, closing = seen.axis, seen.arm.tcp.rotation[:, 2]
    normal = np.cross(v, plain.axis)
    size = float(np.linalg.norm(normal))
    swing = normal * (angle_between(v, plain.axis) / size) if size > 1e-9 else np.zeros(3)
    assert plain.roll is not None
    wanted = plain.roll - (v @ plain.roll) * v
    turn: Vector = swing + math.atan2(float(v @ np.cross(closing, wanted)), float(closing @ wanted)) * v
    return turn


def _stepped(kind: str, tip: Vector, axis: Vector, step: Vector) -> tuple[Vector, Vector]:
    if kind == "translation":
        return tip + step, axis
    size = float(np.linalg.norm(step))
    return tip, rotation_about(step / size, size) @ axis


def _distance(kind: str, now: tuple[Vector, Vector], goal: tuple[Vector, Vector]) -> float:
    return float(np.linalg.norm(now[0] - goal[0])) if kind == "translation" else angle_between(now[1], goal[1])


@contextmanager
def _held_peg(config: CellConfig, case: GridCase) -> Iterator[HeldPeg]:
    """Yield a cell with the case's skin period and a peg in its hand, over the plate."""
    sim = config.sim
    assert sim is not None
    changed = {
        "sim": sim.model_copy(update={"pace": "max"}),
        # The map is that of the arm without errors; `cell study reality` measures their effect.
        "reality": config.reality.model_copy(update={"scale": 0.0}),
        "skin": config.skin.model_copy(update={"rate": 1.0 / case.period}),
        "smoothing": config.smoothing if case.observer else Smoothing(),
    }
    config = config.model_copy(update=changed)
    with opened(assemble(config)) as cell:
        # The loop's limit is measured, so no guard limits the arm.
        ctx, world = replace(cell.context(sim.seed), arm=cell.arm), cell.clock
        assert isinstance(world, World)
        if grasp_from_rack.run(config.params(GRASP), ctx).outcome is not Outcome.SUCCESS:
            raise CellError("study: the peg could not be taken from the rack")
        search = config.params(SEARCH)
        axis, closing = config.peg.part.leaning(search.tilt_azimuth, search.tilt)
        tip = np.array(config.hole.centre) + np.array([0.0, 0.0, HEIGHT])
        for _ in move(Goal(tip, axis, closing), search.transfer, ctx, ctx.in_hand(), settle=1.0):
            pass
        _, data = world.physics()
        yield HeldPeg(cell, world, ctx, config.params(INSERT).gains, closing, np.array(data.qpos))
