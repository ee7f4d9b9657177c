"""The ladder of models, each measured on the same work: speed, accuracy, limits, and the needs of each skill.

A rig pushes the cell's peg at five fixed tilts with 10 N into the cell's hole; sideways the peg is free. The depth is
compared with the exact test by sections. A drag over solid plate reveals seams, and a peg that is 20 um too thick must
stay out. Whole trials and a map of the limits of integration follow. Every model stays in the table: if it penetrates,
it is void; if it never comes to rest, it is unstable.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import mean, stdev

from cell.config.cell_config import CellConfig
from cell.lab.contact.ladder import NOT_RUN, TIGHT, Plan, Rung, model, on_trial
from cell.lab.rows import write_rows
from cell.lab.trials import VOID, TrialRow, run_trial
from cell.lab.workers import Pool
from drivers.part.contract import Part
from drivers.parts import halfway
from drivers.skin.layout import pad_size
from sim import hand_rig, native, rig
from sim.contact import FEATURE_BAND
from sim.pads import grip_limits
from sim.shapes import exact_depth
from sim.truth import VOID_PENETRATION, VOID_SHARE
from skills.catalogue import GRASP
from skills.contract import Outcome

THICKER = 1e-5
"""Excess of the too thick peg over the hole on every side, m."""
BESIDE = 2.45e-3
"""Distance between a dragged peg's edge path and the hole's rim, m."""
SHALLOW, STEEP = (1, 2, 5), (15, 45)
"""Tilts, degrees: of a peg during release, and of a falling peg."""
PUSH, SECONDS = 10.0, 1.5
"""Force, N, and duration, s, of a push."""
AT_REST = 1e-2
"""Speed below which a pushed peg is at rest, m/s."""
EXACT_ENOUGH = 0.01
"""Relative error of the depth that a skill tolerates."""
SMOOTH = 3.0
"""Peak-to-peak lateral force over solid plate that a search tolerates, N."""
MAP_SECONDS, MAP_TILT = 0.6, 5


@dataclass(frozen=True, slots=True)
class RungRow:
    """Result of one rung; a row of contact.csv."""

    name: str
    family: str
    timestep: float
    """Time step of the physics, s."""
    real_time: float
    """Speed of bare physics in multiples of real time, one core."""
    shallow_error: float
    """Worst relative error of the depth at 1 to 5 degrees; infinite if the state is no longer finite."""
    steep_error: float
    """Worst relative error of the depth at 15 and 45 degrees; infinite if the state is no longer finite."""
    penetration: float
    """Deepest penetration that lasted longer than 2 ms, m."""
    is_void: bool
    rests: bool
    drag: float
    """Peak-to-peak lateral force over solid plate, N."""
    keeps_out: bool
    """True if the too thick peg stays out."""
    pushes: int
    """Number of measured pushes."""
    fault: str = ""
    """Reason why the rung has no measurement; empty if it has one."""

    @property
    def error(self) -> float:
        """Return the worst relative error of the depth."""
        return max(self.shallow_error, self.steep_error)


def verdict(row: RungRow) -> str:
    """Return the verdict on a rung in words."""
    if row.fault:
        return row.fault
    wrong = []
    if not math.isfinite(row.error):
        wrong.append("not finite")
    elif row.error > EXACT_ENOUGH:
        wrong.append("wrong depth")
    if row.is_void:
        wrong.append("void")
    if not row.rests:
        wrong.append("does not rest")
    if row.drag > SMOOTH:
        wrong.append("seams")
    if not row.keeps_out:
        wrong.append("lets a thick peg in")
    return ", ".join(wrong) or "good"


@dataclass(frozen=True, slots=True)
class MapRow:
    """One point of the map; a row of integration.csv."""

    hole: str
    timestep: float
    """Time step of the physics, s."""
    stiffness: float
    """Stiffness of the contact, 1/s², with critical damping."""
    verdict: str
    """`holds`, `penetrates` or `unstable`."""


@dataclass(frozen=True, slots=True)
class TrialsRow:
    """Result of whole trials on one rung; a row of outcomes.csv."""

    name: str
    trials: int
    successes: int
    voids: int
    outcomes: str
    """Outcome of each trial, in the order of the seeds."""
    changed: int
    """Number of trials with another ending than on the finest rung."""
    penetration: float
    """Deepest penetration of all trials that lasted longer than 2 ms, m."""
    force: float
    """Mean of the trials' peak contact forces, N."""
    force_error: float
    """Mean of the trials' peak contact forces minus that of the finest rung, N."""
    force_spread: float
    """Standard deviation of the finest rung's peak contact force from seed to seed, N; NaN for a single trial."""
    real_time: float
    """Speed in multiples of real time, one core, everything included."""
    fault: str = ""
    """Reason why there are no trials; empty if there are."""


@dataclass(frozen=True, slots=True)
class Findings:
    """Results of the whole study."""

    rungs: list[RungRow]
    hands: list[hand_rig.HandRow]
    integration: list[MapRow]
    trials: list[TrialsRow]
    tight: list[TrialsRow]
    """Results of the trials with half the clearance."""
    longest_step: float
    """Longest step of a sound grip, see `longest_step`, s."""
    parts: str
    """Sizes of the peg and its hole in words."""


def run(config: CellConfig, todo: Plan, seed: int, done: Callable[[str], None] = lambda name: None) -> Findings:
    """Measure everything.

    Args:
        config: Config of a simulated cell; whole trials take their parts and gains from it.
        todo: Extent of the study.
        seed: Seed of the first trial.
        done: Called after every part.
    """
    seeds, peg, hole = range(seed, seed + todo.trials), config.peg.part, config.hole.part
    cells = [(kind, dt, k) for kind in ("exact", "unpredicted") for dt in todo.timesteps for k in todo.stiffnesses]
    with Pool(todo.workers) as pool:
        rungs = [pool.submit(measure_rung, rung, todo.azimuths, peg, hole) for rung in todo.rungs]
        hands = [pool.submit(hand_rig.measure, kind, config.arm_model(), config.job()) for kind in hand_rig.KINDS]
        points = [pool.submit(measure_point, *cell, peg, hole) for cell in cells]
        tight = [rung for rung in on_trial(peg) if rung.name in TIGHT]
        narrow = _in_half_the_clearance(config)
        tried = [
            [pool.submit(_trial, config, rung, s) for s in seeds] for rung in (on_trial(peg) if todo.trials else ())
        ]
        harder = [[pool.submit(_trial, narrow, rung, seed + n) for n in range(todo.tight)] for rung in tight]
        rows = []
        for rung, future in zip(todo.rungs, rungs, strict=True):
            rows.append(future.result())
            done(rung.name)
        ways = [future.result() for future in hands]
        done("arm and grip")
        integration = [future.result() for future in points]
        done("map of integration")
        results, hard = ([[future.result() for future in futures] for futures in each] for each in (tried, harder))
        done("whole trials")
    trials = [_tried(rung.name, each, results[0]) for rung, each in zip(on_trial(peg), results, strict=False)]
    trials += [_not_run(name, why) for name, why in NOT_RUN.items() if trials]
    narrower = [_tried(rung.name, each, hard[0]) for rung, each in zip(tight, hard, strict=True) if each]
    return Findings(rows, ways, integration, trials, narrower, longest_step(config), f"{size(peg)} in {size(hole)}")


def size(part: Part) -> str:
    """Return the size of a part in words: its extents, or a single extent if every rotation leaves it the same."""
    along, across = (f"{2e3 * half:g}" for half in part.half)
    return f"{along} x {across} mm" if part.symmetry > 0.0 else f"{along} mm"


def longest_step(config: CellConfig) -> float:
    """Return the longest step in which the grip cannot move the peg's end past the contacts ahead of it, s.

    A feature within `FEATURE_BAND` of touch is a contact at any speed. In one step dt from rest, the pads' friction
    torque moves the end by L·(torque / inertia)·dt². Only a contact that exists before the step can stop it.
    """
    job, friction = config.job(), config.grip.friction if config.grip is not None else 0.0
    length, width = pad_size(config.skin.layout)
    torque = grip_limits(
        theta=0.0,
        offset=0.0,
        grip_force=config.params(GRASP).force,
        reach=(job.peg.length, job.peg.overhang),
        half=(length / 2, width / 2),
        friction=max(friction) if isinstance(friction, tuple) else friction,
        flat=job.peg.part.face.flat_width,
    ).torque
    whole, beside = job.peg.length + job.peg.overhang, (job.peg.length - job.peg.overhang) / 2
    inertia = job.peg.mass * (whole**2 / 12 + beside**2)
    return math.sqrt(FEATURE_BAND * inertia / (job.peg.length * torque)) if torque > 0.0 else math.inf


def _not_run(name: str, why: str) -> TrialsRow:
    return TrialsRow(name, 0, 0, 0, "", 0, math.nan, math.nan, math.nan, math.nan, math.nan, why)


def _in_half_the_clearance(config: CellConfig) -> CellConfig:
    """Return the cell with half the difference between hole and peg."""
    return config.model_copy(update={"hole": halfway(config.peg, config.hole)})


def measure_rung(rung: Rung, azimuths: Sequence[float], peg: Part, hole: Part) -> RungRow:
    """Measure one rung on a peg and its hole; if the model cannot work, the row gives the reason."""
    try:
        return _measure_rung(rung, azimuths, peg, hole)
    except Exception as error:  # any failure of a model is a row of the ladder, not the end of the study
        return RungRow(
            rung.name,
            rung.family,
            rung.timestep,
            math.nan,
            math.inf,
            math.inf,
            math.inf,
            True,
            False,
            math.inf,
            False,
            0,
            f"{type(error).__name__}: {error}",
        )


def _measure_rung(rung: Rung, azimuths: Sequence[float], peg: Part, hole: Part) -> RungRow:
    pushes = _push_in(rung, azimuths, peg, hole)
    errors = {degrees: max(push.error for push in pushes if push.degrees == degrees) for degrees in (*SHALLOW, *STEEP)}
    penetration = max(push.penetration for push in pushes)
    return RungRow(
        name=rung.name,
        family=rung.family,
        timestep=rung.timestep,
        real_time=len(pushes) * SECONDS / sum(push.spent for push in pushes),
        shallow_error=max(errors[degrees] for degrees in SHALLOW),
        steep_error=max(errors[degrees] for degrees in STEEP),
        penetration=penetration,
        is_void=penetration > min(VOID_PENETRATION, VOID_SHARE * peg.clearance(hole)),
        rests=all(push.rests for push in pushes),
        drag=_seams(rung, peg, hole),
        keeps_out=_keeps_out(rung, hole),
        pushes=len(pushes),
    )


@dataclass(frozen=True, slots=True)
class _Push:
    """One push of the ladder."""

    degrees: int
    error: float
    """Relative error of the depth; infinite if the state is no longer finite."""
    penetration: float
    """Deepest penetration that lasted longer than 2 ms, m."""
    rests: bool
    spent: float
    """Core time of the push without meters, s."""


def _push_in(rung: Rung, azimuths: Sequence[float], peg: Part, hole: Part) -> list[_Push]:
    """Push the peg in at every tilt and azimuth."""
    made = []
    with native.quiet():
        for degrees in (*SHALLOW, *STEEP):
            tilt = math.radians(degrees)
            for azimuth in azimuths:
                place = (peg, tilt, azimuth, PUSH, SECONDS)
                pushed = rig.push(rig.tilted_peg(peg, hole, tilt, azimuth, 0.0, rung.timestep, rung.model), *place)
                bare = rig.tilted_peg(peg, hole, tilt, azimuth, 0.0, rung.timestep, rung.model, is_judged=False)
                started = time.thread_time()
                rig.push(bare, *place)
                spent = time.thread_time() - started
                error = abs(pushed.depth / exact_depth(peg, hole, rig.attitude(tilt, azimuth)) - 1.0)
                error = error if math.isfinite(error) else math.inf
                made.append(_Push(degrees, error, pushed.penetration, bool(pushed.speed < AT_REST), spent))
    return made


def _seams(rung: Rung, peg: Part, hole: Part) -> float:
    """Return the largest peak-to-peak lateral force over solid plate, N."""
    seams, tilt = 0.0, math.pi / 4
    with native.quiet():
        for direction in (0.4, 1.9):
            over = rig.tilted_peg(peg, hole, tilt, 0.0, 0.0, rung.timestep, rung.model, is_judged=False)
            swing = rig.drag(over, peg, tilt, direction, hole.reach + BESIDE)
            seams = max(seams, swing if math.isfinite(swing) else math.inf)
    return seams


def _keeps_out(rung: Rung, hole: Part) -> bool:
    """Return True if a peg thicker than the hole goes no deeper than its tilt allows."""
    thick, azimuth = hole.grown(THICKER), 0.3
    with native.quiet():
        for degrees in (1, 5):
            tilt = math.radians(degrees)
            over = rig.tilted_peg(thick, hole, tilt, azimuth, 0.2, rung.timestep, rung.model)
            depth = rig.push(over, thick, tilt, azimuth, PUSH, SECONDS).depth
            if not depth <= 1.01 * exact_depth(thick, hole, rig.attitude(tilt, azimuth)) + VOID_PENETRATION:
                return False
    return True


def measure_point(kind: str, timestep: float, stiffness: float, peg: Part, hole: Part) -> MapRow:
    """Measure one point of the map of integration, with the model of the hole named by `kind`."""
    tilt, azimuth = math.radians(MAP_TILT), 0.3
    exact = exact_depth(peg, hole, rig.attitude(tilt, azimuth))
    with native.quiet():
        over = rig.tilted_peg(peg, hole, tilt, azimuth, 0.0, timestep, model(hole=kind, stiffness=stiffness))
        pushed = rig.push(over, peg, tilt, azimuth, PUSH, MAP_SECONDS)
    error = abs(pushed.depth / exact - 1.0)
    if not (math.isfinite(error) and pushed.speed < AT_REST and error < 0.5):
        verdict = "unstable"
    elif pushed.penetration > VOID_PENETRATION or error > EXACT_ENOUGH:
        verdict = "penetrates"
    else:
        verdict = "holds"
    return MapRow(kind, timestep, stiffness, verdict)


def _trial(config: CellConfig, rung: Rung, seed: int) -> tuple[TrialRow, float]:
    """Return the trial's row and its core time, s."""
    assert config.sim is not None
    changed = config.sim.model_copy(update={"timestep": rung.timestep, "model": rung.model})
    started = time.thread_time()
    with native.quiet():
        row = run_trial(config.model_copy(update={"sim": changed}), seed)
    return row, time.thread_time() - started


def _tried(name: str, results: Sequence[tuple[TrialRow, float]], finest: Sequence[tuple[TrialRow, float]]) -> TrialsRow:
    outcomes = [row.outcome for row, _ in results]
    forces, exact = ([row.peak_contact_force for row, _ in each] for each in (results, finest))
    return TrialsRow(
        name=name,
        trials=len(results),
        successes=outcomes.count(Outcome.SUCCESS),
        voids=outcomes.count(VOID),
        outcomes=" ".join(outcomes),
        changed=sum(outcome != row.outcome for outcome, (row, _) in zip(outcomes, finest, strict=True)),
        penetration=max(row.max_penetration for row, _ in results),
        force=mean(forces),
        force_error=mean(forces) - mean(exact),
        force_spread=stdev(exact) if len(exact) > 1 else math.nan,
        real_time=sum(row.sim_time for row, _ in results) / sum(spent for _, spent in results),
    )


def write(found: Findings, folder: Path) -> list[Path]:
    """Write the tables as CSV; return their files."""
    names: dict[str, Sequence[object]] = {
        "contact.csv": found.rungs,
        "arm_and_grip.csv": found.hands,
        "integration.csv": found.integration,
        "outcomes.csv": found.trials,
        "outcomes_tight.csv": found.tight,
    }
    return [write_rows(rows, folder / name) for name, rows in names.items()]
