"""The ladder of models, each measured on the same work: how fast, how exact, where it fails, and what each skill needs.

The work: a peg of 8 mm at a fixed tilt is pushed with 10 N into a hole of 8.1 mm, free to move sideways, at five
tilts; the depth reached is held against the exact test by sections. Beside that a drag over solid plate, which
shows seams, and a peg too thick by 20 um, which must stay out. Then whole trials, and a map of where integration
fails. Every model is marked, none is dropped: one that penetrates is void, one that never rests is unstable.
"""

import csv
import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from statistics import mean, stdev

from cell.config import CellConfig
from cell.lab.contact.ladder import NOT_RUN, TIGHT, Plan, Rung, model, on_trial
from cell.lab.trials import VOID, TrialRow, run_trial
from drivers.parts import halfway
from drivers.skin.layout import pad_size
from sim import hand_rig, native, rig
from sim.contact import FEATURE_BAND
from sim.pads import breakaway_torque_of
from sim.section import section_depth
from sim.truth import VOID_PENETRATION, VOID_SHARE
from skills.catalogue import GRASP
from skills.contract import Outcome

PEG, HOLE = 0.008, 0.0081
"""Diameters, m."""
THICK = HOLE + 2e-5
"""Of the peg that must stay out, m."""
SHALLOW, STEEP = (1, 2, 5), (15, 45)
"""Tilts in degrees: of a peg that is being freed, and of one that falls."""
PUSH, SECONDS = 10.0, 1.5
"""Force, N, and for how long, s."""
AT_REST = 1e-2
"""Speed below which a pushed peg has come to rest, m/s."""
EXACT_ENOUGH = 0.01
"""Error of the depth that a skill bears."""
SMOOTH = 3.0
"""Swing of the lateral force over solid plate that a search bears, N."""
MAP_SECONDS, MAP_TILT = 0.6, 5


@dataclass(frozen=True, slots=True)
class RungRow:
    """What one rung did; a row of contact.csv."""

    name: str
    family: str
    timestep: float
    """s."""
    real_time: float
    """Multiples of real time of bare physics, one core."""
    shallow_error: float
    """Worst relative error of the depth at 1 to 5 degrees; infinite when the state was no longer finite."""
    steep_error: float
    """The same at 15 and 45 degrees."""
    penetration: float
    """Deepest that lasted longer than 2 ms, m."""
    is_void: bool
    rests: bool
    drag: float
    """Swing of the lateral force over solid plate, N."""
    keeps_out: bool
    """Whether the peg that is too thick stays out."""
    pushes: int
    """How often it was measured."""
    fault: str = ""
    """Why it could not be measured at all."""

    @property
    def error(self) -> float:
        """Return the worst relative error of the depth."""
        return max(self.shallow_error, self.steep_error)


def verdict(row: RungRow) -> str:
    """Return in words what became of a rung."""
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
    """s."""
    stiffness: float
    """1/s², with critical damping."""
    verdict: str
    """`holds`, `penetrates` or `unstable`."""


@dataclass(frozen=True, slots=True)
class TrialsRow:
    """Whole trials on one rung; a row of outcomes.csv."""

    name: str
    trials: int
    successes: int
    voids: int
    outcomes: str
    """Outcome of each, in the order of the seeds."""
    changed: int
    """How many end otherwise than on the finest rung."""
    penetration: float
    """Deepest of all that lasted longer than 2 ms, m."""
    force: float
    """Mean of the trials' peak contact forces, N."""
    force_error: float
    """Of it, less the finest rung's, N."""
    force_spread: float
    """Standard deviation of the finest rung's from seed to seed, N; NaN for a single trial."""
    real_time: float
    """Multiples of real time, one core, everything included."""
    fault: str = ""
    """Why there are none."""


@dataclass(frozen=True, slots=True)
class Findings:
    """All that the study measured."""

    rungs: list[RungRow]
    hands: list[hand_rig.HandRow]
    integration: list[MapRow]
    trials: list[TrialsRow]
    tight: list[TrialsRow]
    """The same in half the clearance."""
    longest_step: float
    """See `longest_step`, s."""


def run(config: CellConfig, todo: Plan, seed: int, done: Callable[[str], None] = lambda name: None) -> Findings:
    """Measure everything.

    Args:
        config: A simulated cell; whole trials take their parts and gains from it.
        todo: How much.
        seed: Of the first trial.
        done: Told of every part that is finished.
    """
    seeds = range(seed, seed + todo.trials)
    cells = [(hole, dt, k) for hole in ("exact", "unpredicted") for dt in todo.timesteps for k in todo.stiffnesses]
    with ProcessPoolExecutor(todo.workers, mp_context=get_context("forkserver")) as pool:
        rungs = [pool.submit(measure_rung, rung, todo.azimuths) for rung in todo.rungs]
        hands = [pool.submit(hand_rig.measure, kind, config.arm_model(), config.job()) for kind in hand_rig.KINDS]
        points = [pool.submit(measure_point, *cell) for cell in cells]
        tight = [rung for rung in on_trial() if rung.name in TIGHT]
        narrow = _in_half_the_clearance(config)
        tried = [[pool.submit(_trial, config, rung, s) for s in seeds] for rung in (on_trial() if todo.trials else ())]
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
    trials = [_tried(rung.name, each, results[0]) for rung, each in zip(on_trial(), results, strict=False)]
    trials += [_not_run(name, why) for name, why in NOT_RUN.items() if trials]
    narrower = [_tried(rung.name, each, hard[0]) for rung, each in zip(tight, hard, strict=True) if each]
    return Findings(rows, ways, integration, trials, narrower, longest_step(config))


def longest_step(config: CellConfig) -> float:
    """Return the longest step in which the grip cannot carry the peg's end past the contacts ahead of it, s.

    A feature is a contact within `FEATURE_BAND` of touch whatever its speed. In one step dt from rest the pads' friction
    torque moves the end by L·(torque / inertia)·dt², and what was no contact before that step cannot stop it.
    """
    job, friction = config.job(), config.grip.friction if config.grip is not None else 0.0
    length, width = pad_size(config.skin.layout)
    torque = breakaway_torque_of(
        theta=0.0,
        offset=0.0,
        grip_force=config.params(GRASP).force,
        reach_tip=job.peg.length,
        reach_back=job.peg.overhang,
        half_length=length / 2,
        half_width=width / 2,
        friction=max(friction) if isinstance(friction, tuple) else friction,
        flat=job.peg.part.face.flat_width,
    )
    whole, beside = job.peg.length + job.peg.overhang, (job.peg.length - job.peg.overhang) / 2
    inertia = job.peg.mass * (whole**2 / 12 + beside**2)
    return math.sqrt(FEATURE_BAND * inertia / (job.peg.length * torque)) if torque > 0.0 else math.inf


def _not_run(name: str, why: str) -> TrialsRow:
    return TrialsRow(name, 0, 0, 0, "", 0, math.nan, math.nan, math.nan, math.nan, math.nan, why)


def _in_half_the_clearance(config: CellConfig) -> CellConfig:
    """Return the cell with a hole that is half as much wider than the peg."""
    return config.model_copy(update={"hole": halfway(config.peg, config.hole)})


def measure_rung(rung: Rung, azimuths: Sequence[float]) -> RungRow:
    """Measure one rung; a model that cannot work is told in its row."""
    try:
        return _measure_rung(rung, azimuths)
    except Exception as error:
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


def _measure_rung(rung: Rung, azimuths: Sequence[float]) -> RungRow:
    errors, penetration, rests, spent, steps = {}, 0.0, True, 0.0, 0
    with native.quiet():
        for degrees in (*SHALLOW, *STEEP):
            tilt = math.radians(degrees)
            exact = section_depth(PEG, HOLE, tilt, points=4001)
            worst = 0.0
            for azimuth in azimuths:
                place = (PEG / 2, tilt, azimuth, PUSH, SECONDS)
                pushed = rig.push(rig.tilted_peg(PEG, HOLE, tilt, azimuth, 0.0, rung.timestep, rung.model), *place)
                bare = rig.tilted_peg(PEG, HOLE, tilt, azimuth, 0.0, rung.timestep, rung.model, is_judged=False)
                started = time.thread_time()
                rig.push(bare, *place)
                spent += time.thread_time() - started
                steps += 1
                error = abs(pushed.depth / exact - 1.0)
                worst = max(worst, error if math.isfinite(error) else math.inf)
                penetration = max(penetration, pushed.penetration)
                rests &= bool(pushed.speed < AT_REST)
            errors[degrees] = worst
        seams = 0.0
        for direction in (0.4, 1.9):
            over = rig.tilted_peg(PEG, HOLE, math.pi / 4, 0.0, 0.0, rung.timestep, rung.model, is_judged=False)
            swing = rig.drag(over, PEG / 2, math.pi / 4, direction, 0.0065)
            seams = max(seams, swing if math.isfinite(swing) else math.inf)
        keeps_out = True
        for degrees in (1, 5):
            tilt = math.radians(degrees)
            thick = rig.tilted_peg(THICK, HOLE, tilt, 0.3, 0.2, rung.timestep, rung.model)
            depth = rig.push(thick, THICK / 2, tilt, 0.3, PUSH, SECONDS).depth
            keeps_out &= bool(depth <= 1.01 * section_depth(THICK, HOLE, tilt, points=4001) + VOID_PENETRATION)
    limit = min(VOID_PENETRATION, VOID_SHARE * (HOLE - PEG) / 2)
    return RungRow(
        name=rung.name,
        family=rung.family,
        timestep=rung.timestep,
        real_time=steps * SECONDS / spent,
        shallow_error=max(errors[degrees] for degrees in SHALLOW),
        steep_error=max(errors[degrees] for degrees in STEEP),
        penetration=penetration,
        is_void=penetration > limit,
        rests=rests,
        drag=seams,
        keeps_out=keeps_out,
        pushes=steps,
    )


def measure_point(hole: str, timestep: float, stiffness: float) -> MapRow:
    """Measure one point of the map of integration."""
    tilt = math.radians(MAP_TILT)
    exact = section_depth(PEG, HOLE, tilt, points=4001)
    with native.quiet():
        how = model(hole=hole, stiffness=stiffness)
        pushed = rig.push(
            rig.tilted_peg(PEG, HOLE, tilt, 0.3, 0.0, timestep, how), PEG / 2, tilt, 0.3, PUSH, MAP_SECONDS
        )
    error = abs(pushed.depth / exact - 1.0)
    if not (math.isfinite(error) and pushed.speed < AT_REST and error < 0.5):
        verdict = "unstable"
    elif pushed.penetration > VOID_PENETRATION or error > EXACT_ENOUGH:
        verdict = "penetrates"
    else:
        verdict = "holds"
    return MapRow(hole, timestep, stiffness, verdict)


def _trial(config: CellConfig, rung: Rung, seed: int) -> tuple[TrialRow, float]:
    """Return the trial's row and what it took of a core, s."""
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
    """Write the tables as CSV and return where."""
    names: dict[str, list[dict[str, object]]] = {
        "contact.csv": [asdict(row) for row in found.rungs],
        "arm_and_grip.csv": [asdict(row) for row in found.hands],
        "integration.csv": [asdict(row) for row in found.integration],
        "outcomes.csv": [asdict(row) for row in found.trials],
        "outcomes_tight.csv": [asdict(row) for row in found.tight],
    }
    for name, rows in names.items():
        with (folder / name).open("w", newline="", encoding="utf-8") as file:
            if rows:
                writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
                writer.writeheader()
                writer.writerows(rows)
    return [folder / name for name in names]
