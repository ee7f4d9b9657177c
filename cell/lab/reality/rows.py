"""Named rows of errors with one stated size, single or in pairs: the worst case of a source, and beyond.

Every row runs on the same seeds. After 4, 8, 16 trials and so on, a row ends early if the interval of its success is
below `BORNE`. The trials are thus used for rows that are still undecided.
"""

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from cell.config.cell_config import CellConfig
from cell.config.load import load
from cell.lab.results import TrialsResult, result_of
from cell.lab.trials import TABLE, TrialRow, run_trial, write_table
from cell.lab.workers import on_processes
from cell.records.statistics import wilson
from drivers.arm.kinematics import finger_frame, jacobian, links
from drivers.errors import ConfigError
from drivers.quantities import Vector
from sim.reality import KINDS, AnyError, Figure
from skills.contract import Outcome

ROWS_FILE = "rows.csv"
FILE = "errors.toml"
"""Name of the errors file in the folder of each row."""
BORNE = 0.9
"""Success that the upper end of a row's interval must reach for the row to continue."""
FIRST_BLOCK = 4
"""Number of trials after which a row can first end; each further check doubles it."""
FR3_ROTORS = (0.61, 0.61, 0.46, 0.46, 0.21, 0.21, 0.21)
"""Reflected inertia of the FR3's rotors from the maker, as in Drake's notes, kg·m²."""
SIGMOID: Mapping[str, Figure] = {"arm.sigmoid_friction": 1.0}
FRICTION = (0.0, 0.5, 1.25, 1.5, 2.0, 4.0)
"""Sizes of the joints' friction, multiple of the published level; 2 is the whole span of the published curve as dry
friction, 4 is twice that, beyond every source."""
LATE = 1.0 / 3.0
"""Share of late scans: a computer with three busy neighbours completes 67 of 100 scans in time."""
QUICK = 2
"""Number of rows in a quick study."""


@dataclass(frozen=True, slots=True)
class ErrorRow:
    """One row: the drawn errors, at one size, and other differences."""

    name: str
    figures: Mapping[str, Figure]
    """Size of each error by its name in the errors file; all other errors are zero."""
    preset: str | None = None
    sets: tuple[str, ...] = ()
    force: tuple[float, float, float] | None = None
    """Force that the arm reports above the hole without contact, N, base frame; it changes slightly with the
    posture."""


ROWS: tuple[ErrorRow, ...] = (
    ErrorRow("no error", {}),
    *(ErrorRow(f"joint friction x {level:g}", {"arm.friction_level": level}) for level in FRICTION),
    ErrorRow("sigmoid friction", SIGMOID),
    ErrorRow("fast, no error", {}, "fast"),
    ErrorRow("fast, sigmoid friction", SIGMOID, "fast"),
    ErrorRow("fast, joint friction x 0.5", {"arm.friction_level": 0.5}, "fast"),
    ErrorRow(
        "torques 2 ms late, low-pass of 100 Hz, no rotor inertia", {"arm.transport": 0.002, "arm.torque_lag": 0.0016}
    ),
    ErrorRow("rotor inertia of the FR3", {"arm.rotor_inertia": FR3_ROTORS}),
    ErrorRow("rotor inertia of the FR3, sigmoid friction", {"arm.rotor_inertia": FR3_ROTORS, **SIGMOID}),
    ErrorRow("gravity wrong by 1 N·m on joints 2 and 4", {"arm.gravity": (0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0)}),
    ErrorRow("grip 10 N instead of 30 N", {"grip.force": 1.0 / 3.0}),
    ErrorRow("grip 15 N, pads 0.3", {"grip.force": 0.5}, sets=("grip.friction=0.3",)),
    ErrorRow("grip 10 N, pads 0.2", {"grip.force": 1.0 / 3.0}, sets=("grip.friction=0.2",)),
    ErrorRow("peg 5 mm further out of the hand", {"peg.depth_in_hand": 0.005}),
    ErrorRow("wrench: +4 N along z", {}, force=(0.0, 0.0, 4.0)),
    ErrorRow("wrench: noise 2 N, offset 5 N on each axis", {"arm.wrench_noise": 2.0}, force=(5.0, -5.0, 5.0)),
    ErrorRow("a third of the scans late, by 3 ms in the mean", {"scan.late": LATE, "scan.delay": 0.003}),
    ErrorRow("a third of the scans late, by 10 ms in the mean", {"scan.late": LATE, "scan.delay": 0.01}),
)
"""Rows in the order of the table."""


def blocks(seeds: range) -> list[range]:
    """Return the seeds in blocks; a row can end after each block, with 4, 8, 16, ... completed seeds."""
    found, done, upto = [], 0, FIRST_BLOCK
    while done < len(seeds):
        found.append(seeds[done:upto])
        done, upto = upto, 2 * upto
    return found


@dataclass(frozen=True, slots=True)
class TriedCell:
    """The cell of all rows."""

    path: Path | None
    """TOML file of the cell; None is the default simulated cell."""
    sets: Sequence[str]
    """Keys of all rows."""
    config: CellConfig
    """Config from both."""
    errors: Mapping[str, AnyError]
    """Errors of the cell by name."""


def measure(
    cell: TriedCell, tried: Sequence[ErrorRow], seeds: range, workers: int, folder: Path, done: Callable[[int], None]
) -> list[TrialsResult]:
    """Run every row and write its trials into a separate folder; if a row does not run, its result contains the reason.

    Args:
        cell: The cell of all rows.
        tried: Rows to run.
        seeds: Seeds of the trials of a complete row.
        workers: Number of processes.
        folder: Folder of the rows' folders.
        done: Called with the number of further trials completed or saved.
    """
    configs: dict[str, CellConfig] = {}
    troubles: dict[str, str] = {}
    for row in tried:
        try:
            configs[row.name] = config_of(row, cell, folder / _slug(row))
        except ConfigError as error:
            troubles[row.name] = str(error)
            done(len(seeds))
    trials: dict[str, list[TrialRow]] = {row.name: [] for row in tried}
    for block in blocks(seeds):
        going = [name for name in configs if may_be_borne(trials[name])]
        done((len(configs) - len(going)) * len(block))
        jobs = [(name, seed) for name in going for seed in block]
        for name, trial in on_processes(partial(_run, configs, jobs), range(len(jobs)), workers):
            trials[name].append(trial)
            done(1)
    for row in tried:
        trials[row.name].sort(key=lambda trial: trial.seed)
        write_table(trials[row.name], folder / _slug(row) / TABLE)
    return [result_of(row.name, trials[row.name], troubles.get(row.name, "")) for row in tried]


def _run(configs: Mapping[str, CellConfig], jobs: Sequence[tuple[str, int]], number: int) -> tuple[str, TrialRow]:
    """Run one job, a row's name and a seed; return the name and the trial."""
    name, seed = jobs[number]
    return name, run_trial(configs[name], seed)


def config_of(row: ErrorRow, cell: TriedCell, place: Path) -> CellConfig:
    """Write a row's errors file into `place` and return the config of the row.

    Raises:
        ConfigError: The keys of all rows and those of the row are inconsistent.
    """
    place.mkdir(parents=True, exist_ok=True)
    file = place / FILE
    file.write_text(errors_file(cell.errors, figures_of(row, cell.config)), encoding="utf-8")
    keys = (*row.sets, "reality.scale=1", 'reality.alone=""', f"reality.file={json.dumps(str(file.resolve()))}")
    return load(cell.path, row.preset, [*cell.sets, "sim.pace=max", *keys]).cell


def _slug(row: ErrorRow) -> str:
    return re.sub(r"\W+", "-", row.name).strip("-")


def may_be_borne(trials: Sequence[TrialRow]) -> bool:
    """Return True if the success so far can still reach `BORNE`."""
    return wilson(sum(trial.outcome == Outcome.SUCCESS for trial in trials), len(trials))[1] >= BORNE


def figures_of(row: ErrorRow, config: CellConfig) -> dict[str, Figure]:
    """Return the size of each error of a row by name; a force becomes the joint torques that produce it above the hole."""
    figures = dict(row.figures)
    if row.force is not None:
        figures["arm.wrench_torque"] = tuple(float(torque) for torque in joint_torques(config, np.array(row.force)))
    return figures


def joint_torques(config: CellConfig, force: Vector) -> Vector:
    """Return the joint torques, shape (7,), N·m, of a force at the tool centre point, N, in the posture of the search: Jᵀ F."""
    arm, (q, _) = config.arm_model(), config.place().postures()
    rotations, origins = links(arm, q)
    J = jacobian(finger_frame(arm, q).position, np.array([R[:, 2] for R in rotations]), origins)
    return np.asarray(J[:3].T @ force)


def errors_file(errors: Mapping[str, AnyError], figures: Mapping[str, Figure]) -> str:
    """Return the text of an errors file in which the errors of `figures` are constant, and all others zero."""
    lines = []
    for name, error in errors.items():
        value = figures.get(name, KINDS[name].ideal)
        entries = {
            "about": error.about,
            "unit": error.unit,
            "distribution": "uniform",
            "low": value,
            "high": value,
            "basis": "assumed",
            "source": "A stated size of cell study reality --rows, not a draw",
        }
        lines.append(f"[{name}]")
        lines += [f"{key} = {json.dumps(entry, ensure_ascii=False)}" for key, entry in entries.items()]
    return "\n".join(lines) + "\n"
