"""Stability limits of the loop through the skin on the whole simulated arm, compared with the theory of sampled loops.

The hand takes a peg from the rack and holds it over the plate, tilted as in the search. The setpoint of the peg's tip, or of
its axis, then makes a step, and the study judges the true motion. Skin, estimator, the arm's law and the arm are those of
every trial. Without the observer, the error of [gibbons], Eq. (5), is held between frames, and the joints have no dry friction,
as in the theory; dry friction delays the growth of an oscillation and can stop a small one. With the observer, the cell works as
usual: only theta is as old as the frame, with the configured smoothing, and x_p, v and J_p follow the joints at 1 kHz.
"""

import argparse
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import groupby, product
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from cell.commands.arguments import out_folder
from cell.config.cell_config import CellConfig
from cell.config.margins import HELD, MARGIN, loop_at, margin
from cell.config.sampled_loop import largest_factor
from cell.devices.assembly import Cell, assemble, opened
from cell.lab.arguments import load_simulated
from cell.lab.charts import BLUE, GREEN, INK, RED, Curve, Panel, draw_panels
from cell.lab.report import StudyReport, reported
from cell.lab.tables import Columns, table
from cell.lab.workers import each_of
from drivers import impedance
from drivers.arm.inertia import tip_inertia
from drivers.arm.model import JOINTS
from drivers.errors import CellError, SimulationUnstableError
from drivers.frames import angle_between, end_point, rotation_about, rotation_by
from drivers.quantities import ImpedanceSetpoint, Vector
from sim.world.physics import World
from sim.world.situation import PegSituation
from skills import grasp_from_rack
from skills.catalogue import GRASP, INSERT, SEARCH
from skills.contract import Observation, Outcome, SkillContext
from skills.guards.passivity import PassivityGuard, PassivityVerdict
from skills.motion import Gains, Goal, move
from skills.tactile.blend import Smoothing

FORCE, TORQUE = 15.0, 1.5
"""Largest initial force, N, and torque, N·m, of a step; a quarter of the guard's stop limits."""
STEPS = {"translation": 0.01, "rotation": 0.1}
"""Largest steps of translation, m, and rotation, rad."""
DIRECTIONS = {"translation": np.array([0.8, 0.6, 0.0]), "rotation": np.array([0.6, 0.8, 0.0])}
"""Directions of the step, translation along and rotation about, shape (3,), base frame."""
LOST = 8.0
"""Distance from the setpoint, divided by the largest step, above which a motion ends as unstable."""
PERIODS, LEAST_TIME = 60, 4.0
"""Duration of a case: number of frames, and shortest time, s."""


@dataclass(frozen=True, slots=True)
class Grid:
    """Cases of the map."""

    periods: tuple[float, ...]
    """Periods of the frames, s; multiples of the scan's period."""
    delays: tuple[int, ...]
    """Ages of a frame at its first use, periods of the frames."""
    gains: Mapping[str, Sequence[float]]
    """Gains of translation, N/m, and of rotation, N·m/rad."""


WHOLE = Grid(
    (0.02, 0.05, 0.1, 0.2),
    (0, 1, 2),
    {"translation": np.geomspace(100.0, 51200.0, 10).tolist(), "rotation": np.geomspace(5.0, 2560.0, 10).tolist()},
)
UNITS = {"translation": "N/m", "rotation": "N·m/rad"}
QUICK = Grid((0.05, 0.1), (0, 1), {"translation": (400.0, 2500.0, 20e3), "rotation": (10.0, 300.0, 1000.0)})


@dataclass(frozen=True, slots=True)
class GridCase:
    """One point of the map."""

    kind: str
    """Kind of the step and of the varied gain: `translation` or `rotation`."""
    observer: bool
    """True if only theta is as old as the frame; False if the whole error is held."""
    period: float
    """Period of the frames, s."""
    delay: int
    """Age of a frame at its first use, periods of the frames."""
    gain: float
    """Varied gain, N/m or N·m/rad."""

    @property
    def step(self) -> Vector:
        """Step of the setpoint, shape (3,), m or rad."""
        effort = FORCE if self.kind == "translation" else TORQUE
        return min(STEPS[self.kind], effort / self.gain) * DIRECTIONS[self.kind]


@dataclass(frozen=True, slots=True)
class StepTrace:
    """Result of one case."""

    case: GridCase
    is_stable: bool
    peak: float
    """Largest distance from the setpoint after the step, m or rad."""
    softened_at: float | None
    """Time after the step at which the guard would have softened the motion, s; None if never."""
    stopped_at: float | None
    """Time after the step at which the guard would have stopped the motion, s; None if never."""
    lost_at: float | None
    """Time after the step at which the motion ended as unstable, s; None if never."""


Theory = Mapping[tuple[str, float, int], float]
"""First unstable gain, N/m or N·m/rad, by kind, period and delay, for the arm's own inertia at the pose of the map."""


def shipped_margins(config: CellConfig) -> list[dict[str, Any]]:
    """Return a row for every gain in the loop through the skin: skill, period of the frames, s, and its `Margin`."""
    return [
        {
            "skill": key.removesuffix(".gains"),
            "period": 1.0 / config.skin.rate,
            **asdict(found),
            "margin": found.limit / found.gain,
        }
        for key, gains in config.steered().items()
        for found in (margin(kind, gains, config.skin.rate, config.place()) for kind in HELD)
    ]


def boundaries(base: Gains, inertia: Vector, grid: Grid) -> Theory:
    """Return the theoretical boundary for every period and delay, with the damping ratio of `base`."""
    return {
        (kind, period, delay): largest_factor(partial(loop_at, kind, base, inertia), period, delay)
        * getattr(base, kind)
        for kind, period, delay in product(HELD, grid.periods, grid.delays)
    }


def measure(config: CellConfig, grid: Grid, workers: int) -> tuple[list[StepTrace], Vector]:
    """Run the map; return the result of every case, and the arm's inertia at the tip, shape (6, 6)."""
    columns = [
        [
            GridCase(kind, observer, period, delay, gain)
            for kind, delay in product(HELD, grid.delays)
            for gain in grid.gains[kind]
        ]
        for period, observer in product(sorted(grid.periods, reverse=True), (False, True))
    ]
    results = each_of(_column, [(config, column) for column in columns], workers, "columns of the map")
    traces = [trace for found, _ in results for trace in found]
    traces.sort(key=lambda t: (t.case.kind, t.case.observer, t.case.delay, t.case.period, t.case.gain))
    return traces, results[-1][1]


def _column(config: CellConfig, cases: Sequence[GridCase]) -> tuple[list[StepTrace], Vector]:
    """Run the cases of one column, with common period and observer; a new cell replaces one that has lost its peg."""
    traces: list[StepTrace] = []
    while len(traces) < len(cases):
        with _held_peg(config, cases[0]) as rig:
            while rig.is_usable and len(traces) < len(cases):
                traces.append(rig.run(cases[len(traces)]))
            inertia = rig.inertia
    return traces, inertia


@dataclass(slots=True)
class PegRig:
    """A cell whose hand holds a peg at rest over the plate."""

    cell: Cell
    world: World
    ctx: SkillContext
    base: Gains
    roll: Vector
    """Setpoint of the closing axis, unit, shape (3,), base frame."""
    q: Vector
    """Positions of the whole model at rest, MuJoCo's `qpos`; the arm's joints come first, rad."""
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
        """Make a step of the setpoint and return the result."""
        self._set_down()
        ctx, world = self.ctx, self.world
        theta = world.truth().theta
        limit, step = STEPS[case.kind], case.step
        seen = ctx.observe()
        goal = _stepped(case.kind, seen.tip, seen.axis, step)
        true_goal = _stepped(case.kind, *end_point(world.tcp(), theta, self.length), step)
        gains = self.base.model_copy(update={case.kind: case.gain})
        stiffness, ratios = gains.stiffness(), gains.damping_ratios()
        in_hand = ctx.in_hand()
        plain = ImpedanceSetpoint(ctx.new_id(), *goal, stiffness, ratios, math.inf, in_hand, self.roll)
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
                peg = _used(case, frames).peg
                commanded = replace(plain, in_hand=replace(in_hand, theta=peg.theta))
            elif case.observer and case.delay == 0:  # with the observer, theta is updated at every scan
                commanded = replace(plain, in_hand=ctx.in_hand())
            ctx.devices.arm.follow(commanded)
            away.append(_distance(case.kind, end_point(seen.arm.tcp, theta, self.length), true_goal))
            verdicts.setdefault(guard.update(plain, seen.arm.tcp, seen.stamp), elapsed)
            if away[-1] > LOST * limit:
                break
            try:
                self._advance(case, plain, commanded, frames, seen.stamp)
            except SimulationUnstableError:
                away.append(math.inf)
                self.is_sound = False
                break
        lost = elapsed if away[-1] > LOST * limit else None
        *_, before, swing = (float(np.std(quarter)) for quarter in np.array_split(away, 4))
        return StepTrace(
            case,
            # The swing in the last quarter must shrink, or stay below 0.15 of the largest step, the effect of the skin's noise.
            lost is None and swing < max(before, 0.15 * limit),
            max(away),
            verdicts.get(PassivityVerdict.SOFTEN),
            verdicts.get(PassivityVerdict.STOP),
            lost,
        )

    def _advance(
        self,
        case: GridCase,
        plain: ImpedanceSetpoint,
        commanded: ImpedanceSetpoint,
        frames: Sequence[Observation],
        stamp: float,
    ) -> None:
        """Advance by one scan from `stamp`, s; without the observer, the setpoint moves with the arm in every control period, so that the
        error of a frame is held.
        """
        ctx, world = self.ctx, self.world
        if case.observer:
            world.wait_until(stamp + ctx.schedule.period)
            return
        assert commanded.in_hand is not None
        used = _used(case, frames)
        error = np.concatenate([plain.tip - used.tip, _turn(used, plain)]) * (len(frames) > case.delay)
        end = world.now() + ctx.schedule.period
        while world.now() < end - 1e-9:
            tcp = ctx.devices.arm.read().tcp
            tip, axis = end_point(tcp, commanded.in_hand.theta, commanded.in_hand.length)
            if case.kind == "translation":
                ctx.devices.arm.follow(replace(commanded, tip=tip + error[:3]))
            else:
                roll = float(error[3:] @ axis)
                swing, closing = error[3:] - roll * axis, tcp.rotation[:, 2]
                turned = (rotation_by(swing) @ axis, rotation_by(roll * axis) @ closing)
                ctx.devices.arm.follow(replace(commanded, axis=turned[0], roll=turned[1]))
            world.wait_until(world.now() + world.arm.control_period)

    def _set_down(self) -> None:
        """Restore the positions of arm and peg, at rest, and wait until the skin has measured them."""
        _, data = self.world.physics()
        data.qpos[:], data.qvel[:] = self.q, 0.0
        self.world.control.law[:] = impedance.new_state(self.world.arm)
        self.ctx.devices.arm.halt()
        self.world.wait_until(self.world.now() + 2.0 / self.cell.config.skin.rate)


def _used(case: GridCase, frames: Sequence[Observation]) -> Observation:
    """Return the frame in use when the newest frame arrives: the newest, or an older one by the case's delay."""
    return frames[max(len(frames) - 1 - case.delay, 0)]


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
def _held_peg(config: CellConfig, case: GridCase) -> Iterator[PegRig]:
    """Yield a cell with the case's skin period and a peg in its hand, over the plate."""
    sim = config.sim
    assert sim is not None
    changed = {
        "sim": sim.model_copy(update={"pace": "max"}),
        # The map is that of the arm without errors; `cell study margins` measures their effect.
        "reality": config.reality.model_copy(update={"scale": 0.0}),
        "skin": config.skin.model_copy(update={"rate": 1.0 / case.period}),
        "smoothing": config.smoothing if case.observer else Smoothing(),
    }
    config = config.model_copy(update=changed)
    with opened(assemble(config)) as cell:
        # The study measures the limit of the loop itself, so no guard limits the arm.
        ctx, world = cell.context(sim.seed), cell.clock
        ctx = replace(ctx, devices=replace(ctx.devices, arm=cell.arm))
        assert isinstance(world, World)
        if grasp_from_rack.run(config.params(GRASP), ctx).outcome is not Outcome.SUCCESS:
            raise CellError("study: the peg could not be taken from the rack")
        search = config.params(SEARCH)
        axis, closing = config.peg.part.leaning(search.tilt_azimuth, search.tilt)
        # Height of the tip above the hole, m, at which the arm moves freely.
        tip = np.array(config.hole.centre) + np.array([0.0, 0.0, 0.1])
        for _ in move(Goal(tip, axis, closing), search.transfer, ctx, ctx.in_hand(), settle=1.0):
            pass
        model, data = world.physics()
        if not case.observer:  # the theory has no dry friction
            model.dof_frictionloss[:] = 0.0
        yield PegRig(cell, world, ctx, config.params(INSERT).gains, closing, np.array(data.qpos))


def limit_of(case: GridCase, theory: Theory) -> float:
    """Return the first unstable gain of a case in theory, N/m or N·m/rad."""
    return theory[case.kind, case.period, case.delay]


def compare(traces: Sequence[StepTrace], theory: Theory) -> dict[str, int]:
    """Count the stable and the unstable cases below and above the gain at which theory predicts instability.

    Only cases without the observer count, because the theory describes that loop.
    """
    counts = {"stable_below": 0, "unstable_above": 0, "stable_above": 0, "unstable_below": 0}
    for trace in traces:
        if not trace.case.observer:
            side = "below" if trace.case.gain < limit_of(trace.case, theory) else "above"
            counts[f"{'stable' if trace.is_stable else 'unstable'}_{side}"] += 1
    return counts


def caught(traces: Sequence[StepTrace]) -> dict[str, int]:
    """Count the cases that the guard would have stopped."""
    unstable = [trace for trace in traces if not trace.is_stable]
    return {
        "unstable": len(unstable),
        "unstable_stopped": sum(trace.stopped_at is not None for trace in unstable),
        "unstable_with_observer": sum(trace.case.observer for trace in unstable),
        "stable": len(traces) - len(unstable),
        "stable_stopped": sum(trace.is_stable and trace.stopped_at is not None for trace in traces),
    }


def _row(trace: StepTrace, theory: Theory) -> dict[str, Any]:
    facts = asdict(trace)
    return {**facts.pop("case"), "theory": limit_of(trace.case, theory), **facts}


def draw(
    kind: str, traces: Sequence[StepTrace], theory: Theory, shipped: Sequence[Mapping[str, Any]], folder: Path
) -> Path:
    """Draw the map of translation or of rotation: delays side by side, the observer off above and on below; return the file."""
    of_kind = (trace for trace in traces if trace.case.kind == kind)
    groups = groupby(of_kind, key=lambda trace: (trace.case.observer, trace.case.delay))
    panels = [_panel(list(group), theory, shipped) for _, group in groups]
    title = f"Stability in {kind} on the whole simulated arm, {len(traces)} cases, one run a point"
    return draw_panels(panels, title, folder / f"stability_{kind}.png", len(panels) // 2, legend=3)


def _panel(traces: Sequence[StepTrace], theory: Theory, shipped: Sequence[Mapping[str, Any]]) -> Panel:
    """Return the map of cases with common kind, observer and delay."""
    case = traces[0].case
    periods = sorted({trace.case.period for trace in traces})
    curves = [
        _points([(trace.case.period, trace.case.gain) for trace in filter(is_so, traces)], *look, is_hollow=True)
        for look, is_so in MARKS.items()
    ]
    if not case.observer:
        line = [(period, theory[case.kind, period, case.delay]) for period in periods]
        curves.append(_points(line, "boundary of theory, the arm's own inertia", GREEN, "-", 1.5))
    if case.delay == 0:
        own = [(each["period"], each["gain"]) for each in shipped if each["kind"] == case.kind]
        curves.append(_points(own, "shipped gains", INK, "*", 3.0))
    ticks = [1e3 * period for period in periods]
    labels = "period of the skin (ms)", f"gain in {case.kind} ({UNITS[case.kind]})"
    title = f"{NAMES[case.observer]}\nframes used {case.delay} periods late"
    return Panel(title, *labels, curves, "xy", ticks, x_limits=(ticks[0] / 1.4, ticks[-1] * 1.4))


def _points(
    at: Sequence[tuple[float, float]], label: str, colour: str, style: str, size: float, is_hollow: bool = False
) -> Curve:
    """Return periods, s, and gains as marks or a line."""
    x, y = [1e3 * period for period, _ in at], [gain for _, gain in at]
    return Curve(x, y, colour, label, style, size, is_hollow=is_hollow)


NAMES = {
    True: "observer on: only theta is as old as the frame",
    False: "observer off, no dry friction: the error is held",
}
"""Title of a panel, by the observer."""
MARKS: Mapping[tuple[str, str, str, float], Callable[[StepTrace], bool]] = {
    ("stable", BLUE, "o", 1.5): lambda trace: trace.is_stable,
    ("unstable", RED, "x", 1.8): lambda trace: not trace.is_stable,
    ("stopped by the guard", INK, "s", 3.0): lambda trace: trace.stopped_at is not None,
    ("softened by it", INK, "D", 3.0): lambda trace: trace.stopped_at is None and trace.softened_at is not None,
}
"""Label, colour, style and size of the marks of cases, and the cases that have them."""


MARGINS: Columns = {
    "value": lambda line: f"{line['gain']:g} {UNITS[line['kind']]}",
    "unstable from": lambda line: f"{line['limit']:.4g} {UNITS[line['kind']]}",
    "margin": lambda line: f"{line['margin']:.2f} times",
}
"""Columns of the table of gains that the skin steers."""


def run(args: argparse.Namespace) -> StudyReport:
    """Measure the map, compare it with theory, write every case, draw the charts."""
    config, folder, grid = load_simulated(args).cell, out_folder(args.out), QUICK if args.quick else WHOLE
    traces, inertia = measure(config, grid, args.workers)
    theory, shipped = boundaries(config.params(INSERT).gains, inertia, grid), shipped_margins(config)
    arm, guard = compare(traces, theory), caught(traces)
    rows = [_row(trace, theory) for trace in traces]
    charts = [draw(kind, traces, theory, shipped, folder) for kind in HELD]
    shown = table(
        "Gains that the skin steers, against the boundary of theory",
        {"skill": itemgetter("skill"), "gain": itemgetter("kind")},
        MARGINS,
        shipped,
        f"margin needed {MARGIN:g}; n = {len(traces)}. Observer off: {arm['stable_below']} stable below the boundary"
        f" and {arm['unstable_below']} not, {arm['unstable_above']} unstable above it and {arm['stable_above']} not."
        f" Observer on: {guard['unstable_with_observer']} unstable. Guard: stops {guard['unstable_stopped']} of"
        f" {guard['unstable']} unstable, {guard['stable_stopped']} of {guard['stable']} stable.",
    )
    return reported(
        shown,
        folder,
        {"stability.csv": rows},
        charts,
        cases=len(traces),
        against_theory=arm,
        guard=guard,
        margin_needed=MARGIN,
        shipped=shipped,
    )
