"""Drawn arms: calibrated, compared with their true figures, and tried with and without their calibration."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import date
from functools import partial
from pathlib import Path

import numpy as np

from cell.calibrate.arm import calibrate_arm
from cell.config.cell_config import CellConfig
from cell.lab.reality.measure import errors_of
from cell.lab.reality.rows import ROWS, TriedCell, config_of
from cell.lab.results import TrialsResult, result_of
from cell.lab.trials import TABLE, TrialRow, run_trial, write_table
from cell.lab.workers import on_processes
from drivers.arm.calibration import ArmCalibration
from drivers.errors import CellError, ConfigError, NotCalibratedError
from drivers.quantities import Vector
from sim import joint_drive
from sim.drawn_arm import drawn_arm
from sim.reality import Reality

SCALES = {"honest arms": 1.0, "careless arms": 2.0}
"""Scale of the errors by the name of the arms."""
NAMED = ("joint friction x 4", "rotor inertia of the FR3, sigmoid friction")
"""Rows of `cell.lab.reality.rows` in addition to the drawn arms."""
SIDES = ("without", "with")
STEP = 5e-4
"""Step for the conversion of the true friction to words, s; its value has no effect here."""


@dataclass(frozen=True, slots=True)
class Tried:
    """One arm, its calibration, and its first peg without and with it."""

    kind: str
    seed: int
    trouble: str
    """Reason why the calibration failed; empty if it succeeded."""
    held: int
    """Number of figures whose interval contains the true value: friction at each speed and offset of each joint."""
    figures: int
    """Number of all these figures."""
    worst: float
    """Largest difference between a figure and its true value, N·m."""
    trials: tuple[TrialRow, ...]
    """Trials without the calibration and, if there is one, with it."""


@dataclass(frozen=True, slots=True)
class KindLine:
    """All arms of one kind."""

    kind: str
    arms: int
    calibrated: int
    held: int
    figures: int
    worst: float
    results: tuple[TrialsResult, ...]
    """Results without and with the calibration, of the arms with a calibration."""
    troubles: str


def kinds(
    path: Path | None, sets: Sequence[str], config: CellConfig, folder: Path, names: Sequence[str]
) -> dict[str, CellConfig]:
    """Return the config of every kind of arm, or of the named kinds.

    Raises:
        ConfigError: A kind of that name does not exist.
    """
    cell = TriedCell(path, sets, config, errors_of(config))
    known = [*SCALES, *NAMED]
    for name in names:
        if name not in known:
            raise ConfigError(f"--arms {name}: no such kind; {', '.join(known)} allowed")
    found = {}
    for name in names or known:
        if name in SCALES:
            reality = config.reality.model_copy(update={"scale": SCALES[name]})
            found[name] = config.model_copy(update={"reality": reality})
        else:
            row = next(row for row in ROWS if row.name == name)
            found[name] = config_of(row, cell, folder / "errors" / name.replace(" ", "-"))
    return found


def measure(
    configs: Mapping[str, CellConfig], seeds: range, workers: int, folder: Path, done: Callable[[int], None]
) -> list[KindLine]:
    """Calibrate and test an arm of every kind for every seed; each arm's file stays in the folder.

    Args:
        configs: Config of each kind of arm.
        seeds: Seeds, one arm each.
        workers: Number of processes.
        folder: Folder of the files.
        done: Called with the number of further completed arms.
    """
    jobs = [(kind, seed) for kind in configs for seed in seeds]
    tried: list[Tried] = []
    for each in on_processes(partial(_try, dict(configs), jobs, folder), range(len(jobs)), workers):
        tried.append(each)
        done(1)
    (folder / "arms.json").write_text(json.dumps([asdict(each) for each in tried], indent=1) + "\n", encoding="utf-8")
    return [_line(kind, sorted((t for t in tried if t.kind == kind), key=lambda t: t.seed), folder) for kind in configs]


def _try(configs: Mapping[str, CellConfig], jobs: Sequence[tuple[str, int]], folder: Path, number: int) -> Tried:
    kind, seed = jobs[number]
    config = configs[kind]
    assert config.sim is not None
    config = config.model_copy(update={"sim": config.sim.model_copy(update={"seed": seed})})
    without = run_trial(config, seed)
    try:
        found = calibrate_arm(config, date.today(), lambda done, of: None)
    except (NotCalibratedError, CellError) as error:
        return Tried(kind, seed, str(error), 0, 0, 0.0, (without,))
    file = folder / f"{kind.replace(' ', '-')}_{seed}.toml"
    found.write(file)
    calibration = config.calibration.model_copy(update={"arm": file.resolve()})
    trial = run_trial(config.model_copy(update={"calibration": calibration}), seed)
    apart, intervals = differences(found, config, seed)
    held = int(np.count_nonzero(apart <= intervals))
    return Tried(kind, seed, "", held, apart.size, float(apart.max()), (without, trial))


def differences(found: ArmCalibration, config: CellConfig, seed: int) -> tuple[Vector, Vector]:
    """Return the errors of friction at each speed and of the offset, and their intervals, shape (n, 7), N·m."""
    drawn = Reality(errors_of(config)).draw(seed, config.reality)
    arm = drawn_arm(config.arm_model(), drawn)
    words = joint_drive.words_of(arm, config.arm_model().control_period, (STEP, STEP))

    def takes(speed: float) -> Vector:
        smooth = [joint_drive.friction(words, joint, speed) for joint in range(len(arm.gravity))]
        return np.asarray(np.array(smooth) + np.sign(speed) * np.array(arm.friction.dry) - np.array(arm.gravity))

    true = [0.5 * (takes(speed) - takes(-speed)) for speed in found.speeds]
    true.append(np.mean([takes(sense * speed) for speed in found.speeds for sense in (-1.0, 1.0)], axis=0))
    told = [*found.friction, found.offset]
    apart = np.abs(np.array([each.value for each in told]) - np.array(true))
    return apart, np.array([each.interval for each in told])


def _line(kind: str, tried: Sequence[Tried], folder: Path) -> KindLine:
    good = [each for each in tried if not each.trouble]
    results = []
    for number, side in enumerate(SIDES):
        rows = [each.trials[number] for each in good]
        place = folder / f"{kind.replace(' ', '-')}-{side}"
        place.mkdir(parents=True, exist_ok=True)
        write_table(rows, place / TABLE)
        results.append(result_of(f"{kind}, {side}", rows))
    return KindLine(
        kind=kind,
        arms=len(tried),
        calibrated=len(good),
        held=sum(each.held for each in good),
        figures=sum(each.figures for each in good),
        worst=max((each.worst for each in good), default=0.0),
        results=tuple(results),
        troubles="; ".join(f"{each.seed}: {each.trouble}" for each in tried if each.trouble),
    )
