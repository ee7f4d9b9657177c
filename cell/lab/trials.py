"""Many insertions, each on a fresh simulated cell with its own seed, on every core; one row each in trials.csv."""

import json
import math
import platform
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from itertools import filterfalse, takewhile
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from cell.config.cell_config import CellConfig
from cell.devices.assembly import Cell, assemble, opened
from cell.lab.published import PUBLISHED, Tried, stage_table
from cell.lab.rows import known, successes, write_rows
from cell.lab.workers import on_cluster, on_processes
from cell.peg.ending import Ending, ending_of
from cell.peg.part_state import PartState
from cell.peg.success import LastLook, SeatingProof, evidence_for, judged
from cell.records.provenance import config_hash, versions
from cell.records.statistics import spread, wilson
from cell.run.record import StageClock
from drivers.errors import CellError, ConfigError, FaultCode
from drivers.quantities import ImpedanceSetpoint
from plc_bridge.protocol.messages import PartPlace
from skills.catalogue import CATALOGUE, INSERT
from skills.contract import Observation, Outcome, SkillContext
from skills.entry import Claim
from skills.flow import StageRecord
from skills.search.spray_search import SpraySearchResult

if TYPE_CHECKING:
    from sim.world.truth import Truth


class Probe:
    """Observes one trial and adds columns to its row; this one adds none."""

    def __init__(self, cell: Cell, ctx: SkillContext) -> None:
        """Prepare to observe a trial before it begins; a probe may replace parts of the trial's context."""
        self._cell, self._ctx = cell, ctx

    def record(self, seen: Observation, setpoint: ImpedanceSetpoint | None) -> None:
        """Observe one scan."""

    def columns(self, records: Sequence[StageRecord]) -> dict[str, str]:
        """Return further columns of the row, by name, from the stages of the ended trial."""
        return {}


MakeProbe = Callable[[Cell, SkillContext], Probe]
Program = Callable[[Cell, SkillContext], list[StageRecord]]
"""Function that inserts a peg in an opened cell; a study can use another one instead of the cell's own program."""


def insert_peg(cell: Cell, ctx: SkillContext) -> list[StageRecord]:
    """Run the cell's own program."""
    return CATALOGUE["insert_peg"].run(cell.config.skill_set(), ctx)


WATCHED = frozenset({"spray_search", "tactile_insert"})
"""Stages in which the estimate in use is compared with the truth."""
VOID = "void"
"""Outcome of a trial in which bodies penetrated each other, instead of an `Outcome`."""
LOADS = {
    "peak_contact_force": ("largest contact force (N)", 1),
    "time_over_20N": ("time above 20 N (s)", 2),
    "jerk_free": ("largest jerk in free space (m/s³)", 0),
    "jerk_contact": ("largest jerk elsewhere (m/s³)", 0),
}
"""Name in words and decimals of each load of a trial, by its column."""
TABLE, PARTIAL, SUMMARY = "trials.csv", "trials.partial.jsonl", "summary.json"


@dataclass(frozen=True, slots=True)
class TrialRow:
    """One row of trials.csv; SI units and radians, empty if a stage was not reached."""

    seed: int
    outcome: str
    """An `Outcome`, or `VOID`; a fault counts as a failure."""
    reason: str
    stage: str
    grasp_time: float | None
    search_time: float | None
    insert_time: float | None
    adjust_time: float | None
    total_time: float | None
    """Total time, search + insertion + adjustment, s."""
    retries: int
    peak_contact_force: float
    max_penetration: float
    max_in_hand_rotation: float
    theta_rmse: float | None
    tip_rmse: float | None
    hole_x: float
    hole_y: float
    start_x: float | None
    start_y: float | None
    switch_closed: bool
    depth: float
    sim_time: float
    wall_time: float
    cycle_time: float = math.nan
    """Time from the command to the end of the program, with transfers, grasp and release, s."""
    time_over_20N: float = math.nan  # noqa: N815 - the column's name is part of the contract
    """Time with a reported force above 20 N, s."""
    plate_penetration: float = math.nan
    """Deepest penetration of a plate's surface or a hole's floor that lasted longer than 2 ms, m."""
    grip_slip: float = math.nan
    """Largest slip of the peg along and across the fingers since the grasp, m."""
    found_error: float | None = None
    """Distance of the peg's end from the hole's axis along the plate, m, when the last search reported the hole."""
    jerk_free: float = math.nan
    """Largest jerk of the finger centre in free space, m/s³, after a low-pass of 10 Hz."""
    jerk_contact: float = math.nan
    """Largest jerk of the finger centre at all other times, m/s³, after the same low-pass."""
    more: dict[str, str] = field(default_factory=dict)
    """Further columns by name: drawn errors of the cell, then those of a probe."""

    def tried(self) -> Tried:
        """Return the row in the form of the stage table."""
        names = ("search_time", "insert_time", "adjust_time")
        times = {
            stage.name: value
            for stage, name in zip(PUBLISHED, names, strict=True)
            if (value := getattr(self, name)) is not None
        }
        return Tried(self.outcome == Outcome.SUCCESS, self.stage, times)


@dataclass(slots=True)
class Watcher:
    """Compares the estimate in use with the truth, at every scan of the watched stages."""

    cell: Cell
    ctx: SkillContext
    probe: Probe
    """Probe that observes the same scans."""
    proof: SeatingProof
    """Evidence of the peg's seating so far, of the kind that the job's hole requires."""
    clock: StageClock = field(default_factory=StageClock)
    ending: "Truth | None" = None
    """True state at the end of the insertion, before the removal of any part."""
    found_error: float | None = None
    """Distance of the peg's end from the hole's axis in the first scan after the last search, m; None before."""
    count: int = 0
    theta: float = 0.0
    """Sum of squared errors of theta, rad²."""
    tip: float = 0.0
    """Sum of squared errors of the tip, m²."""

    def record(self, seen: Observation, setpoint: ImpedanceSetpoint | None) -> None:
        """Add one scan."""
        self.probe.record(seen, setpoint)
        begins = self.clock.enter(self.ctx.stage, seen.stamp)
        self.proof = self.proof.after(seen, setpoint)
        if self.cell.truth is None or self.cell.pivot is None:
            return
        if begins and self.ctx.stage == INSERT.name:
            truth = self.cell.truth()
            self.found_error = math.dist(truth.tip[:2], truth.hole[:2])
        if self.ctx.stage == "recover":
            self.ending = self.ending or self.cell.truth()
        if self.ctx.stage not in WATCHED:
            return
        theta, tip = self.cell.pivot()
        if math.isnan(theta):
            return
        self.count += 1
        self.theta += (seen.peg.theta - theta) ** 2
        self.tip += math.dist(seen.tip, tip) ** 2

    def judged(self, ending: Ending, records: Sequence[StageRecord]) -> Ending:
        """Return the ending of the trial from the evidence, as the supervisor does.

        Raises:
            CellError: The skills report success and the evidence contradicts it.
        """
        cell = self.cell
        look = LastLook(cell.gripper.read(), cell.arm.read().tcp.position, cell.switch.read())
        nobody = PartState(PartPlace.UNKNOWN, "")
        return judged(Claim.INSERTED, ending, records, self.proof, look, nobody, self.ctx.job)

    def rmse(self, total: float) -> float | None:
        """Return the root mean square error, or None without data."""
        return math.sqrt(total / self.count) if self.count else None


def run_trial(config: CellConfig, seed: int, probe: MakeProbe = Probe, program: Program = insert_peg) -> TrialRow:
    """Run a program once on a fresh cell drawn from `seed`, without sockets and without waiting for the wall clock."""
    wall = time.perf_counter()
    with opened(assemble(seeded(config, seed))) as cell:
        row = trial_in(cell, seed, probe=probe, program=program)
    return replace(row, wall_time=time.perf_counter() - wall)


def seeded(config: CellConfig, seed: int) -> CellConfig:
    """Return the config of a cell that is drawn from `seed` and runs at full speed."""
    assert config.sim is not None
    return config.model_copy(update={"sim": config.sim.model_copy(update={"seed": seed, "pace": "max"})})


def _start_of(records: Sequence[StageRecord]) -> tuple[float | None, float | None]:
    """Return x and y of the start of the first search, m, base frame; None if there was no search."""
    begun = (record.result.start for record in records if isinstance(record.result, SpraySearchResult))
    found = next(begun, None)
    return (float(found[0]), float(found[1])) if found else (None, None)


def trial_in(
    cell: Cell,
    seed: int,
    probe: MakeProbe = Probe,
    program: Program = insert_peg,
) -> TrialRow:
    """Run a program once in an opened cell.

    A fault ends the trial as a failure, with the fault's name as the reason. The times include the whole stage with the fault.
    """
    wall = time.perf_counter()
    assert cell.truth is not None
    ctx, began = cell.context(seed), cell.clock.now()
    watcher = Watcher(cell, ctx, probe(cell, ctx), evidence_for(ctx.job.hole))
    ctx.callbacks = replace(ctx.callbacks, ended=watcher.clock.end, record=watcher.record)
    records: list[StageRecord] = []
    try:
        records = program(cell, ctx)
        ending = watcher.judged(ending_of(records, None, ctx.stage), records)
        outcome, reason = ending.outcome, ending.word
    except CellError as error:
        ending = ending_of(records, error, ctx.stage)
        outcome, reason = Outcome.FAILURE, FaultCode(error.code).name.lower()
    truth = watcher.ending or cell.truth()
    sim_time = cell.clock.now()
    watcher.clock.leave(sim_time)
    times = watcher.clock.times
    start_x, start_y = _start_of(records)
    stages = [times[name] for name in CATALOGUE.counted if name in times]
    return TrialRow(
        seed=seed,
        outcome=VOID if truth.is_void else outcome,
        reason=reason,
        stage=ending.stage,
        grasp_time=times.get("grasp_from_rack"),
        search_time=times.get("spray_search"),
        insert_time=times.get("tactile_insert"),
        adjust_time=times.get("spiral_adjust"),
        total_time=sum(stages) if stages else None,
        retries=sum(record.retried for record in records),
        peak_contact_force=truth.peak_contact_force,
        max_penetration=truth.max_penetration,
        max_in_hand_rotation=truth.max_in_hand_rotation,
        theta_rmse=watcher.rmse(watcher.theta),
        tip_rmse=watcher.rmse(watcher.tip),
        hole_x=truth.hole[0],
        hole_y=truth.hole[1],
        start_x=start_x,
        start_y=start_y,
        switch_closed=truth.switch_closed,
        depth=truth.depth,
        sim_time=sim_time,
        wall_time=time.perf_counter() - wall,
        cycle_time=sim_time - began,
        time_over_20N=truth.time_over_20N,
        plate_penetration=truth.plate_penetration,
        grip_slip=truth.grip_slip,
        found_error=watcher.found_error,
        jerk_free=truth.jerk_free,
        jerk_contact=truth.jerk_contact,
        more={**cell.errors, **watcher.probe.columns(records)},
    )


def run_trials(
    config: CellConfig,
    seeds: Sequence[int],
    workers: int,
    folder: Path,
    done: Callable[[TrialRow], None],
    scheduler: str | None = None,
    is_enough: Callable[[Sequence[TrialRow]], bool] | None = None,
    probe: MakeProbe = Probe,
    program: Program = insert_peg,
    run: Callable[..., TrialRow] = run_trial,
) -> list[TrialRow]:
    """Run a trial of every seed on `workers` processes, or on a cluster, and return the rows, sorted by seed.

    Finished rows go to a partial file. If the call is repeated, it reuses them and runs only the missing seeds.

    Args:
        config: Config of the cell of every trial, except its seed.
        seeds: Seeds, one trial each.
        workers: Number of processes; the rows do not depend on it.
        folder: Folder of trials.csv and summary.json.
        done: Function called with every row, including those of an earlier call.
        scheduler: Address of a Dask scheduler whose workers run the trials; None runs them on this computer.
        is_enough: Function that returns True if the rows of the first seeds are enough. The call ends with the smallest
            number of rows that is enough and returns only these rows, independent of the number of processes. None runs
            every seed.
        probe: Function that prepares each trial and returns its probe.
        program: Program of every trial.
        run: Function that runs one trial, with the arguments of `run_trial`.

    Raises:
        ConfigError: The folder is not writable, or the packages for a cluster are missing.
        CellError: A worker was killed, or the cluster is unreachable.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        kept = (folder / PARTIAL).open("a+", encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"--out {folder}: cannot be written: {error.strerror}") from None
    with kept:
        rows = {row.seed: row for row in _resume(kept, config) if row.seed in set(seeds)}
        for row in rows.values():
            done(row)
        order = sorted(seeds)

        def is_over() -> bool:
            return _ending(rows, order, is_enough) is not None

        missing = [] if is_over() else list(filterfalse(rows.__contains__, seeds))
        task = partial(run, config, probe=probe, program=program)
        began, taken_up = time.perf_counter(), len(rows)
        if scheduler:
            results = on_cluster(task, missing, scheduler, is_over)
        else:
            results = on_processes(task, missing, workers, is_over)
        with closing(results):
            for row in results:
                rows[row.seed] = row
                kept.write(json.dumps(asdict(row)) + "\n")
                kept.flush()
                done(row)
        ordered = _ending(rows, order, is_enough) or []
    minutes = (time.perf_counter() - began) / 60.0
    write_table(ordered, folder / TABLE)
    summary = summarise(ordered, config) | {"trials_per_minute": (len(rows) - taken_up) / minutes}
    (folder / SUMMARY).write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    return ordered


def _ending(
    rows: Mapping[int, TrialRow], order: Sequence[int], is_enough: Callable[[Sequence[TrialRow]], bool] | None
) -> list[TrialRow] | None:
    """Return the final rows in the order of the seeds, or None while seeds are missing."""
    first = [rows[seed] for seed in takewhile(rows.__contains__, order)]
    if is_enough is not None:
        for count in range(1, len(first) + 1):
            if is_enough(first[:count]):
                return first[:count]
    return first if len(first) == len(order) else None


def _resume(kept: TextIO, config: CellConfig) -> list[TrialRow]:
    """Return the rows of an interrupted call with the same config and versions, and prepare the file for appending.

    Complete rows stay in the file, so that no row is lost if the process is killed at this point.
    """
    head = json.dumps({"config": config_hash(config), "versions": versions()}) + "\n"
    kept.seek(0)
    lines = kept.read().splitlines(keepends=True)
    rows: list[TrialRow] = []
    if lines and lines[0] == head:
        for line in lines[1:]:
            if not line.endswith("\n"):
                break  # an incomplete last row
            try:
                rows.append(TrialRow(**json.loads(line)))
            except (json.JSONDecodeError, TypeError):
                break
        kept.truncate(sum(len(line.encode()) for line in lines[: 1 + len(rows)]))
    else:
        kept.truncate(0)
        kept.write(head)
        kept.flush()
    return rows


def write_table(rows: Sequence[TrialRow], path: Path) -> None:
    """Write rows as CSV."""
    empty, cells = {name: "" for row in rows for name in row.more}, []
    for row in rows:
        own = asdict(row)
        more = own.pop("more")
        cells.append({**own, "switch_closed": str(row.switch_closed).lower(), **empty, **more})
    write_rows(cells, path)


def summarise(rows: Sequence[TrialRow], config: CellConfig) -> dict[str, Any]:
    """Return counts, the interval of the success rate, times of the successes, loads of all, versions and the whole config."""
    outcomes = Counter(row.outcome for row in rows)
    good = successes(rows)
    low, high = wilson(len(good), len(rows))
    times = ("grasp_time", "search_time", "insert_time", "adjust_time", "total_time", "sim_time", "wall_time")
    return {
        "trials": len(rows),
        "seeds": [rows[0].seed, rows[-1].seed] if rows else [],
        "outcomes": {name: outcomes[name] for name in (Outcome.SUCCESS, Outcome.FAILURE, Outcome.ABORTED, VOID)},
        "reasons": dict(Counter(f"{row.stage}: {row.reason}" for row in rows if row.reason)),
        "success_rate": len(good) / len(rows) if rows else None,
        "wilson_95": [low, high],
        "times": {name: spread(known(map(attrgetter(name), good))) for name in times},
        "loads": {name: load(rows, name) for name in LOADS},
        "stages": list(map(asdict, stage_table([row.tried() for row in rows]))),
        "config_hash": config_hash(config),
        "versions": {"python": platform.python_version(), **versions()},
        "config": config.model_dump(mode="json"),
    }


def load(rows: Sequence[TrialRow], name: str) -> dict[str, float] | None:
    """Return mean, median, 95th percentile and largest value of one of `LOADS` over all trials; None without values."""
    values = [getattr(row, name) for row in rows]
    found = spread(values)
    return None if found is None else {**found, "largest": max(values)}
