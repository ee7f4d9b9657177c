"""Trials measured phase by phase from the simulation's truth: passes over the hole, rotation in it, downward motion."""

import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cell.config.cell_config import CellConfig
from cell.devices.assembly import Cell, assemble, opened
from cell.lab.frontier.measure import load_variant
from cell.lab.limits.bounds import mobility, turning_force
from cell.lab.limits.cases import Case
from cell.lab.workers import on_processes
from cell.peg.ending import ending_of
from cell.records.provenance import config_hash, versions
from drivers.errors import CellError, ConfigError, FaultCode
from drivers.frames import angle_between
from drivers.quantities import ImpedanceSetpoint, Vector
from sim.world import World
from skills.catalogue import ADJUST, CATALOGUE, INSERT, SEARCH
from skills.contract import Observation, Outcome, SkillContext
from skills.paths import Lanes
from skills.search.course import leading
from skills.search.params import SpraySearchParams
from skills.spray_search import SpraySearchResult

ROWS = "limits.jsonl"
PHASES = (SEARCH.name, INSERT.name, ADJUST.name)
"""Measured stages."""
SLIDING = 0.6
"""Share of the lanes' speed above which the peg is sliding along a lane."""
LEFT = 1.5e-3
"""Distance from the hole's rim at which a peg has left the hole, m."""
STAYS = 0.2
"""Time after which a peg that has not left the hole is detected, s; at 0.05 m/s it takes 0.19 s to cross 8.1 mm and
`LEFT`."""
SPEED_OVER = 0.015
"""Shortest time from the rim for the computation of the speed, s; a drop by 0.3 mm takes 0.02 s."""
WATCHED = 0.12
"""Recording time of a drop, s."""
RATE_OVER = 4
"""Number of scans for the computation of a rotation's rate."""


@dataclass(frozen=True, slots=True)
class Pass:
    """One pass of the tilted peg over the hole along a lane."""

    offset: float
    """Distance of the centre of the lanes' planned band from the hole's centre, across the lane, m."""
    speed: float
    """Mean speed along the lane at the start of the drop, m/s; after a turn, a peg held back by friction is faster than
    its lane."""
    is_noticed: bool
    """True if it stopped over the hole."""
    mass: float
    """Effective mass of the hand along the normal at the peg's lowest point, kg."""
    push: float
    """Push of the setpoint, N: stiffness along z times its depth below the surface."""
    fall: tuple[tuple[float, float], ...]
    """Time since its lowest point passed the rim, s, and depth of that point, m, scan by scan."""


@dataclass(frozen=True, slots=True)
class Turn:
    """Rotation of a peg in its hole, up to the start of the adjustment."""

    time: float
    angle: float
    """Decrease of its tilt, rad."""
    rate: float
    """Largest rate, rad/s."""
    force: float
    """Largest force between peg and hole in a scan, N, after the meters' low-pass of 5 ms."""
    coupling: float
    """Size of the force per angular acceleration about the tip, across the normal, N per rad/s²."""
    push: float
    """Push of the first setpoint, N."""


@dataclass(frozen=True, slots=True)
class Way:
    """Downward motion in the hole, scan by scan, from the start of the adjustment."""

    mass: float
    """Effective mass of the hand along the hole at the peg's tip, kg."""
    moment: float
    """Moment of inertia of the hand about the tip and the axis of the peg's tilt, kg·m²."""
    scans: tuple[tuple[float, float, float], ...]
    """Time, s, depth of the tip, m, and tilt of the peg from the hole's axis, rad."""


@dataclass(frozen=True, slots=True)
class LimitsRow:
    """One trial, phase by phase; SI units, None if a phase was not reached."""

    case: str
    seed: int
    outcome: str
    reason: str
    search_time: float | None = None
    """Time of all searches of the trial, s."""
    share: float | None = None
    """Share of the first cover before the hole, fraction."""
    cover: float | None = None
    """Planned time of a cover, s."""
    rests: int = 0
    """Number of times that contact evidence stopped the path."""
    passes: tuple[Pass, ...] = ()
    turn: Turn | None = None
    way: Way | None = None


def row_from(data: dict[str, Any]) -> LimitsRow:
    """Return the row from its `asdict` form."""
    passes = tuple(Pass(**{**each, "fall": tuple(map(tuple, each["fall"]))}) for each in data["passes"])
    turn = Turn(**data["turn"]) if data["turn"] else None
    way = Way(**{**data["way"], "scans": tuple(map(tuple, data["way"]["scans"]))}) if data["way"] else None
    return LimitsRow(**{**data, "passes": passes, "turn": turn, "way": way})


def searching(config: CellConfig) -> SpraySearchParams:
    """Return the search parameters of a cell for its part."""
    return config.handling().search


@dataclass(slots=True)
class _Over:
    """A pass in progress."""

    offset: float
    mass: float
    push: float
    since: float
    """Time at which the lowest point passed the rim, s."""
    begin: float
    """Position along the lane at that time, m."""
    speed: float = 0.0
    fall: list[tuple[float, float]] = field(default_factory=list)


class Tracer:
    """Observes every scan of a trial in the simulation's truth."""

    def __init__(self, cell: Cell, ctx: SkillContext, search: SpraySearchParams) -> None:
        """Begin without observations."""
        self._cell, self._ctx, self._search = cell, ctx, search
        self._world = world_of(cell)
        part = ctx.job.peg.part
        self._lean = np.array([math.cos(search.tilt_azimuth), math.sin(search.tilt_azimuth), 0.0])
        self._ahead = leading(part.reach, search.tilt, search.fall)
        self._radius = ctx.job.hole.part.inscribed / 2.0
        self._fast = 0 if search.fast_axis == "x" else 1
        self._stage, self._began = "", 0.0
        self._last: tuple[float, Vector] | None = None
        self._over: _Over | None = None
        self._tilts: list[tuple[float, float]] = []
        self._force, self._coupling, self._push = 0.0, 0.0, 0.0
        self._mass, self._moment = 0.0, 0.0
        self._scans: list[tuple[float, float, float]] = []
        self.passes: list[Pass] = []
        self.turn: Turn | None = None
        self.way: Way | None = None

    def record(self, seen: Observation, setpoint: ImpedanceSetpoint | None) -> None:
        """Add one scan."""
        stage, world = self._ctx.stage, self._world
        now = world.now()
        if stage != self._stage:
            self.leave()
            self._stage, self._began = stage, now
        if not world.is_held or stage not in PHASES:
            return
        sight = world.peg_pose()
        axis, normal = sight.rotation[:, 2], world.plate.rotation[:, 2]
        tip = self._local(world.stepper.end())
        if stage == SEARCH.name:
            closing_axis = world.tcp().rotation[:, 2]
            edge = self._ctx.job.peg.part.lowest(world.stepper.end(), axis, closing_axis)
            self._slide(now, tip, self._local(edge), edge, setpoint)
        elif stage == INSERT.name:
            self._raise(now, axis, normal, setpoint)
        else:
            if not self._scans:
                self._mass, self._moment = self._upright(axis, normal)
            lean = angle_between(axis, normal)
            self._scans.append((round(now - self._began, 4), _small(-tip[2]), _small(lean)))

    def leave(self) -> None:
        """End the present phase."""
        if self._stage == SEARCH.name:
            self._end_pass(is_noticed=True)
            self._last = None
        if self._tilts:
            self.turn = self._turned()
            self._tilts, self._force = [], 0.0
        if self._scans:
            self.way = Way(_small(self._mass), _small(self._moment), tuple(self._scans))
            self._scans = []

    def _slide(self, now: float, tip: Vector, edge: Vector, place: Vector, setpoint: ImpedanceSetpoint | None) -> None:
        """Add a scan of the search.

        Args:
            now: Time, s.
            tip: Vector from the hole's centre to the centre of the peg's end, m, in the plate's axes.
            edge: Lowest point of the peg, in the same form.
            place: The same point, m, base frame.
            setpoint: Setpoint of the arm.
        """
        last, self._last = self._last, (now, edge)
        if last is None or now <= last[0]:
            return
        away, before = math.hypot(edge[0], edge[1]), math.hypot(last[1][0], last[1][1])
        if self._over is None and away < self._radius <= before:
            share = (before - self._radius) / (before - away)
            self._over = _Over(
                offset=_small(float((tip + self._ahead * self._lean) @ self._lean)),
                mass=_small(mobility(self._world.inertia(place), self._world.plate.rotation[:, 2])),
                push=0.0 if setpoint is None else _small(float(setpoint.stiffness[2]) * self._search.push_offset),
                since=last[0] + share * (now - last[0]),
                begin=float(last[1][self._fast] + share * (edge - last[1])[self._fast]),
            )
        over = self._over
        if over is None:
            return
        gone = now - over.since
        if gone <= WATCHED:
            over.fall.append((round(gone, 5), _small(-edge[2])))
        if over.speed == 0.0 and gone >= SPEED_OVER:
            over.speed = _small(abs(float(edge[self._fast]) - over.begin) / gone)
        if away > self._radius + LEFT or now - over.since > STAYS:
            self._end_pass(is_noticed=away <= self._radius + LEFT)

    def _end_pass(self, is_noticed: bool) -> None:
        over, self._over = self._over, None
        if over is not None and over.speed > SLIDING * self._search.speed:
            self.passes.append(Pass(over.offset, over.speed, is_noticed, over.mass, over.push, tuple(over.fall)))

    def _raise(self, stamp: float, axis: Vector, normal: Vector, setpoint: ImpedanceSetpoint | None) -> None:
        """Add a scan of the insertion."""
        if not self._tilts:
            about = np.cross(axis, normal)
            force = turning_force(self._world.inertia(self._world.stepper.end()), about / np.linalg.norm(about))
            self._coupling = float(np.linalg.norm(force - (force @ normal) * normal))
        if len(self._tilts) == 1 and setpoint is not None:
            self._push = float(setpoint.stiffness[2]) * self._cell.config.params(INSERT).push_offset
        self._tilts.append((stamp, angle_between(axis, normal)))
        self._force = max(self._force, float(np.linalg.norm(self._world.contact_force())))

    def _upright(self, axis: Vector, normal: Vector) -> tuple[float, float]:
        """Return the mass of the hand along the hole, kg, and its moment of inertia about the tip and the axis of the tilt, kg·m²."""
        inertia, about = self._world.inertia(self._world.stepper.end()), np.cross(axis, normal)
        about /= np.linalg.norm(about)
        return mobility(inertia, normal), float(about @ inertia[3:, 3:] @ about)

    def _turned(self) -> Turn:
        (begin, first), (end, last) = self._tilts[0], self._tilts[-1]
        rates = [
            (a - b) / (until - since)
            for (since, a), (until, b) in zip(self._tilts, self._tilts[RATE_OVER:], strict=False)
            if until > since
        ]
        return Turn(
            time=round(end - begin, 4),
            angle=_small(first - last),
            rate=_small(max(rates, default=0.0)),
            force=_small(self._force),
            coupling=_small(self._coupling),
            push=_small(self._push),
        )

    def _local(self, point: Vector) -> Vector:
        """Return the vector from the hole's centre to a point, m, base frame, in the plate's axes."""
        place: Vector = self._world.plate.rotation.T @ (point - self._world.plate.position)
        return place


def world_of(cell: Cell) -> World:
    """Return the simulated world with a cell's true state."""
    world = getattr(cell.truth, "__self__", None)
    assert isinstance(world, World)
    return world


def run_trial(config: CellConfig, case: str, seed: int) -> LimitsRow:
    """Run one insertion on a fresh cell of this seed and observe its phases."""
    assert config.sim is not None
    config = config.model_copy(update={"sim": config.sim.model_copy(update={"seed": seed, "pace": "max"})})
    cell = assemble(config)
    with opened(cell):
        ctx = cell.context(seed)
        tracer = Tracer(cell, ctx, searching(config))
        ctx.record = tracer.record
        try:
            records = CATALOGUE["insert_peg"].run(config.skill_set(), ctx)
            ending = ending_of(records, None, ctx.stage)
            outcome, reason = str(ending.outcome), ending.word
        except CellError as error:
            records, outcome, reason = [], str(Outcome.FAILURE), FaultCode(error.code).name.lower()
        tracer.leave()
        hole = world_of(cell).plate.position
    found = [record.result for record in records if isinstance(record.result, SpraySearchResult)]
    path = found[0].left.path if found and found[0].left is not None else None
    share, cover = (None, None) if not isinstance(path, Lanes) else _share(path, hole[:2] - config.hole.centre[:2])
    return LimitsRow(
        case=case,
        seed=seed,
        outcome=outcome,
        reason=reason,
        search_time=sum(result.elapsed for result in found) or None,
        share=share,
        cover=cover,
        rests=sum(result.rests for result in found),
        passes=tuple(tracer.passes),
        turn=tracer.turn,
        way=tracer.way,
    )


def _share(path: Lanes, hole: Vector) -> tuple[float, float]:
    """Return the share of the first cover at the lanes' nearest point to the hole, from the centre of the area, m, and its time, s."""
    times = np.arange(0.0, path.cover, 1e-3)
    near = min(times, key=lambda time: math.dist(path.at(float(time))[0], hole))
    return float(near) / path.cover, path.cover


def _small(value: float) -> float:
    """Return a value with seven digits, the precision of a row."""
    return float(f"{value:.7g}")


def measure(
    path: Path | None,
    sets: Sequence[str],
    tried: Sequence[Case],
    seeds: range,
    workers: int,
    folder: Path,
    done: Callable[[int], None],
) -> list[LimitsRow]:
    """Run the trials of every case and return their rows; existing rows in the folder are reused.

    Args:
        path: TOML file of the cell; None is the simulated cell that ships with the program.
        sets: Keys of all trials.
        tried: Cases to run.
        seeds: Seeds, one trial each, for every case.
        workers: Number of processes.
        folder: Folder of the rows.
        done: Called with the number of further completed trials.
    """
    rows: list[LimitsRow] = []
    with _kept(folder / ROWS) as (known, keep):
        for case in tried:
            config = load_variant(path, case.variant.preset, [*sets, *case.variant.sets])
            mark = config_hash(config)
            own = [row for (of, seed), row in known.items() if of == mark and seed in seeds]
            missing = [seed for seed in seeds if (mark, seed) not in known]
            done(len(own))
            with closing(on_processes(partial(run_trial, config, case.name), missing, workers)) as results:
                for row in results:
                    keep(mark, row)
                    own.append(row)
                    done(1)
            rows += sorted(own, key=lambda row: row.seed)
    return rows


@contextmanager
def _kept(
    path: Path,
) -> Iterator[tuple[dict[tuple[str, int], LimitsRow], Callable[[str, LimitsRow], None]]]:
    """Yield the rows of an earlier call of the same versions, by config and seed, and a function that stores another row at once."""
    known: dict[tuple[str, int], LimitsRow] = {}
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()] if path.exists() else []
    lines = [line for line in lines if line["versions"] == versions()]
    for line in lines:
        known[line["config"], line["row"]["seed"]] = row_from(line["row"])
    with path.open("w", encoding="utf-8") as file:

        def write(line: dict[str, Any]) -> None:
            file.write(json.dumps(line) + "\n")
            file.flush()

        for line in lines:
            write(line)
        yield known, lambda mark, row: write({"config": mark, "versions": versions(), "row": asdict(row)})


def read_rows(path: Path) -> list[LimitsRow]:
    """Return the rows stored by `measure`.

    Raises:
        ConfigError: The file does not exist or has other content.
    """
    try:
        return [row_from(json.loads(line)["row"]) for line in path.read_text(encoding="utf-8").splitlines()]
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise ConfigError(f"{path}: not the rows of this study: {type(error).__name__}: {error}") from None
