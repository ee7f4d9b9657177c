"""Where the loop through the skin goes unstable on the whole simulated arm, beside what sampled-loop theory says.

A peg is taken from the rack and held over the plate, tilted as in the search. Then the setpoint of its tip, or of its
axis, steps aside, and what follows is judged by truth. Skin, estimator, the arm's law and the arm are those of every
trial. Without the observer the error of [gibbons], Eq. (5), is held from frame to frame, as a controller does that
knows nothing in between; with it the cell works as it always does: theta alone is as old as the frame, smoothed as the
config says, and x_p, v and J_p follow the joints at 1 kHz.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import numpy as np

from cell.assembly import Cell, assemble, opened
from cell.config import CellConfig
from cell.lab.workers import on_processes
from cell.margins import HELD, margins
from cell.sampled_loop import largest_factor
from drivers.arm.inertia import tip_inertia
from drivers.arm.model import JOINTS
from drivers.errors import CellError, SimulationUnstableError
from drivers.frames import angle_between, end_point, rotation_about
from drivers.quantities import ImpedanceSetpoint, InHandTip, Twist, Vector
from sim.situation import Peg
from sim.world import World
from skills import grasp_from_rack
from skills.catalogue import GRASP, INSERT, SEARCH
from skills.contract import Observation, Outcome, SkillContext
from skills.motion import Gains, Goal, move
from skills.passivity import PassivityGuard, Verdict
from skills.tactile.blend import Smoothing

HEIGHT = 0.1
"""Of the tip over the hole, m: the arm moves freely."""
FORCE, TORQUE = 15.0, 1.5
"""A step presses with so much at first, N and N·m: a quarter of what the guard stops at."""
STEPS = {"translation": 0.01, "rotation": 0.1}
"""The largest step, m and rad."""
DIRECTIONS = {"translation": np.array([0.8, 0.6, 0.0]), "rotation": np.array([0.6, 0.8, 0.0])}
"""Of the step along, or about, shape (3,), base frame."""
LOST = 8.0
"""Further than so many of the largest steps from the setpoint a motion is given up: it is unstable."""
RESTLESS = 0.25
"""So is one that still swings in its last quarter: standard deviation, in largest steps. Dry friction ends less."""
PERIODS, LEAST_TIME = 30, 2.0
"""How long a case lasts: so many frames, at least so long, s."""


@dataclass(frozen=True, slots=True)
class Grid:
    """What is tried."""

    periods: tuple[float, ...]
    """Between frames, s; multiples of the scan's."""
    delays: tuple[int, ...]
    """Age of a frame when it is first used, in frames."""
    gains: dict[str, tuple[float, ...]]
    """Of translation, N/m, and rotation, N·m/rad."""


def _geometric(low: float, high: float, count: int) -> tuple[float, ...]:
    return tuple(float(x) for x in np.geomspace(low, high, count))


WHOLE = Grid(
    (0.02, 0.05, 0.1, 0.2),
    (0, 1, 2),
    {"translation": _geometric(100.0, 51200.0, 10), "rotation": _geometric(5.0, 2560.0, 10)},
)
QUICK = Grid((0.05, 0.1), (0, 1), {"translation": (400.0, 2500.0, 20e3), "rotation": (10.0, 80.0, 1000.0)})


@dataclass(frozen=True, slots=True)
class Case:
    """One point of the map."""

    kind: str
    """`translation` or `rotation`: what steps, and whose gain is tried."""
    observer: bool
    period: float
    """Between frames, s."""
    delay: int
    """In frames."""
    gain: float
    """N/m or N·m/rad."""


@dataclass(frozen=True, slots=True)
class Trace:
    """What became of it."""

    case: Case
    is_stable: bool
    peak: float
    """Largest distance from the setpoint after the step, m or rad."""
    softened_at: float | None
    """When the guard would have softened the motion, s after the step."""
    stopped_at: float | None
    """When it would have stopped it, s."""
    lost_at: float | None
    """When the motion was given up, s."""


@dataclass(frozen=True, slots=True)
class Boundary:
    """What theory says, at the arm's own inertia where the map was made."""

    kind: str
    period: float
    delay: int
    gain: float
    """First unstable one, its damping ratio that of the insertion's gains."""


@dataclass(frozen=True, slots=True)
class Shipped:
    """One gain of the config, and how far it is from the boundary of theory."""

    skill: str
    kind: str
    period: float
    """Of the skin, s."""
    gain: float
    limit: float
    """First unstable one, its damping as it is, the error as old as a frame used at once."""
    margin: float
    """Limit over gain."""


def shipped_margins(config: CellConfig) -> list[Shipped]:
    """Return the margins of every gain that the skin steers."""
    return [
        Shipped(key.removesuffix(".gains"), found.kind, 1.0 / config.skin.rate, found.gain, found.limit, found.factor)
        for key, gains in config.steered().items()
        for found in margins(gains, config.skin.rate, config.place())
    ]


def gains_of(base: Gains, kind: str, gain: float) -> tuple[Vector, Vector]:
    """Return stiffness and damping, each shape (6,), with one gain set and its damping ratio kept."""
    stiffness, damping = base.stiffness(), base.damping()
    factor = gain / getattr(base, kind)
    held = np.diag(HELD[kind]) > 0.0
    stiffness[held] *= factor
    damping[held] *= math.sqrt(factor)
    return stiffness, damping


def boundaries(base: Gains, inertia: Vector, grid: Grid) -> list[Boundary]:
    """Return the boundary of theory for every period and delay."""
    stiffness, damping = np.diag(base.stiffness()), np.diag(base.damping())
    found = []
    for kind, period, delay in product(HELD, grid.periods, grid.delays):
        held = HELD[kind] @ stiffness
        factor = largest_factor(inertia, held, stiffness - held, damping, period, delay, power=0.5)
        found.append(Boundary(kind, period, delay, factor * getattr(base, kind)))
    return found


def measure(config: CellConfig, grid: Grid, workers: int, done: Callable[[int], None]) -> tuple[list[Trace], Vector]:
    """Run the map.

    Args:
        config: A simulated cell.
        grid: What to try.
        workers: Processes.
        done: Told how many more cases are done.

    Returns:
        What became of every case, and the arm's inertia at the tip, shape (6, 6).
    """
    columns = [
        [
            Case(kind, observer, period, delay, gain)
            for kind, delay in product(HELD, grid.delays)
            for gain in grid.gains[kind]
        ]
        for period, observer in product(sorted(grid.periods, reverse=True), (False, True))
    ]
    traces: list[Trace] = []
    inertia = np.zeros((6, 6))
    for column, found in on_processes(partial(_column, config, columns), range(len(columns)), workers):
        inertia = found
        traces += column
        done(len(column))
    return sorted(
        traces, key=lambda t: (t.case.kind, t.case.observer, t.case.delay, t.case.period, t.case.gain)
    ), inertia


def _column(config: CellConfig, columns: Sequence[Sequence[Case]], number: int) -> tuple[list[Trace], Vector]:
    """Run the cases of one column, which share period and observer; a cell that lost its peg is replaced."""
    traces: list[Trace] = []
    cases = columns[number]
    while len(traces) < len(cases):
        with _bench(config, cases[0]) as bench:
            while bench.is_usable and len(traces) < len(cases):
                traces.append(bench.run(cases[len(traces)]))
            inertia = bench.inertia
    return traces, inertia


@dataclass(slots=True)
class Bench:
    """A cell whose hand holds a peg still over the plate."""

    cell: Cell
    world: World
    ctx: SkillContext
    base: Gains
    roll: Vector
    q: Vector
    """Of the model, the peg's hinge included."""
    is_sound: bool = True
    """The physics stayed finite."""

    @property
    def is_usable(self) -> bool:
        """Whether another case can be run."""
        return self.is_sound and self.world.truth().peg is Peg.HELD

    @property
    def inertia(self) -> Vector:
        """The arm's, at the tip, shape (6, 6)."""
        return tip_inertia(self.world.arm, self.q[:JOINTS], self.length)

    @property
    def length(self) -> float:
        """Distance from the finger centre to the peg's end, m."""
        return self.cell.config.peg.length

    def run(self, case: Case) -> Trace:
        """Step the setpoint aside and watch."""
        self._set_down()
        ctx, world = self.ctx, self.world
        theta = world.truth().theta
        limit = STEPS[case.kind]
        step = min(limit, (FORCE if case.kind == "translation" else TORQUE) / case.gain) * DIRECTIONS[case.kind]
        seen = ctx.observe()
        goal = _stepped(case.kind, seen.tip, seen.axis, step)
        truth = _stepped(case.kind, *end_point(world.tcp(), theta, self.length), step)
        stiffness, damping = gains_of(self.base, case.kind, case.gain)
        plain = ImpedanceSetpoint(ctx.new_id(), *goal, stiffness, damping, math.inf, ctx.in_hand(), self.roll)
        guard = PassivityGuard(ctx.limits.force)
        begin, away = world.now(), [0.0]
        verdicts: dict[Verdict, float] = {}
        frames: list[Observation] = []
        lasting = max(PERIODS * case.period, LEAST_TIME)
        while (elapsed := world.now() - begin) < lasting:
            seen = ctx.observe()
            if seen.is_new_frame or not frames:
                frames.append(seen)
                ctx.arm.follow(_commanded(case, plain, frames))
            elif case.observer and case.delay == 0:
                # An observer may know more of theta at every scan.
                ctx.arm.follow(replace(plain, in_hand=ctx.in_hand()))
            away.append(_distance(case.kind, end_point(seen.arm.tcp, theta, self.length), truth))
            verdicts.setdefault(guard.update(plain, seen.arm.tcp, seen.stamp), elapsed)
            if away[-1] > LOST * limit:
                break
            try:
                world.wait_until(seen.stamp + ctx.scan_period)
            except SimulationUnstableError:
                away.append(math.inf)
                self.is_sound = False
                break
        lost = elapsed if away[-1] > LOST * limit else None
        swing = float(np.std(away[-len(away) // 4 :])) if lost is None else math.inf
        return Trace(
            case,
            lost is None and swing < RESTLESS * limit,
            max(away),
            verdicts.get(Verdict.SOFTEN),
            verdicts.get(Verdict.STOP),
            lost,
        )

    def _set_down(self) -> None:
        """Put arm and peg back to where they were, at rest, and let the skin see them."""
        _, data = self.world.physics()
        data.qpos[:], data.qvel[:] = self.q, 0.0
        self.world.control.law[:] = 0.0
        self.ctx.arm.halt()
        self.world.wait_until(self.world.now() + 2.0 / self.cell.config.skin.rate)


def _commanded(case: Case, plain: ImpedanceSetpoint, frames: Sequence[Observation]) -> ImpedanceSetpoint:
    """Return what is handed to the arm at a frame."""
    used = frames[max(len(frames) - 1 - case.delay, 0)]
    assert plain.in_hand is not None
    in_hand = InHandTip(used.peg.theta, plain.in_hand.length, used.peg.stamp)
    if case.observer:
        return replace(plain, in_hand=in_hand)
    # The law damps the twist less the setpoint's: with no stiffness, a twist of K e / D is the force K e, held.
    held = np.diag(HELD[case.kind]) > 0.0
    error = np.concatenate([plain.tip - used.tip, _turn(used, plain)])
    if len(frames) <= case.delay:
        error[:] = 0.0
    force = np.where(held, plain.stiffness * error / plain.damping, 0.0)
    return replace(
        plain,
        stiffness=np.where(held, 0.0, plain.stiffness),
        twist=Twist(force[:3], force[3:]),
        in_hand=in_hand,
        roll=plain.roll if case.kind == "translation" else None,
    )


def _turn(seen: Observation, plain: ImpedanceSetpoint) -> Vector:
    """Return the rotation from how the peg was seen to how it shall be, as the law has it, shape (3,), rad."""
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
def _bench(config: CellConfig, case: Case) -> Iterator[Bench]:
    """Yield a cell whose skin has the case's period, a peg in its hand, over the plate."""
    sim = config.sim
    assert sim is not None
    changed = {
        "sim": sim.model_copy(update={"pace": "max"}),
        "skin": config.skin.model_copy(update={"rate": 1.0 / case.period}),
        "smoothing": config.smoothing if case.observer else Smoothing(),
    }
    config = config.model_copy(update=changed)
    with opened(assemble(config)) as cell:
        ctx, world = cell.context(sim.seed), cell.clock
        assert isinstance(world, World)
        if grasp_from_rack.run(config.params(GRASP), ctx).outcome is not Outcome.SUCCESS:
            raise CellError("study: the peg could not be taken from the rack")
        search = config.params(SEARCH)
        axis, closing = config.peg.part.leaning(search.tilt_azimuth, search.tilt)
        tip = np.array(config.hole.centre) + np.array([0.0, 0.0, HEIGHT])
        for _ in move(Goal(tip, axis, closing), search.transfer, ctx, ctx.in_hand(), settle=1.0):
            pass
        _, data = world.physics()
        yield Bench(cell, world, ctx, config.params(INSERT).gains, closing, np.array(data.qpos))
