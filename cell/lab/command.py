"""What `cell study NAME` runs: every study takes the command's arguments and returns what is to be shown."""

import argparse
import json
import math
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from rich.console import RenderableType
from rich.progress import Progress

from cell.config import LoadedConfig
from drivers.errors import ConfigError
from skills.catalogue import SEARCH


@dataclass(frozen=True, slots=True)
class Shown:
    """The result of a study."""

    tables: Sequence[RenderableType]
    result: object
    """The same for JSON."""
    written: list[Path] = field(default_factory=list)


def speed(args: argparse.Namespace, loaded: LoadedConfig, progress: Progress) -> Shown:
    """How fast the stand-in runs, and with --profile where the time goes."""
    from cell.lab import speed as study  # compiles; only when asked for
    from cell.tables import profile, speed

    if args.profile:
        parts = study.profile(loaded.cell, args.seed)
        return Shown([profile(parts)], [asdict(part) for part in parts])
    lines = study.measure(loaded.cell, args.seed)
    return Shown([speed(lines)], [asdict(line) for line in lines])


def contact(args: argparse.Namespace, loaded: LoadedConfig, progress: Progress) -> Shown:
    """The ladder of models: how fast, how exact, where they fail, what each skill needs."""
    from cell.lab import contact as study  # compiles; only when asked for
    from cell.lab import contact_pictures, ladder, needs

    folder = _out_folder(args.out)
    plan = ladder.plan(args.quick, args.workers or os.cpu_count() or 1)
    bar = progress.add_task("parts", total=len(plan.rungs) + 3)
    found = study.run(loaded.cell, plan, args.seed, lambda name: progress.advance(bar))
    written = study.write(found, folder)
    written += contact_pictures.draw(found, folder)
    tables = contact_pictures.tables(found)
    result: dict[str, Any] = {
        "rungs": [asdict(row) for row in found.rungs],
        "arm_and_grip": [asdict(row) for row in found.hands],
        "trials": [asdict(row) for row in found.trials],
        "tight": [asdict(row) for row in found.tight],
        "needed": [asdict(row) for row in needs.needed(found)],
    }
    return Shown(tables, _finite(result), written)


def line(args: argparse.Namespace, loaded: LoadedConfig, progress: Progress) -> Shown:
    """The line to the PLC."""
    from cell.lab import line as study
    from cell.tables import line

    samples = study.measure(loaded, study.QUICK if args.quick else study.FULL)
    lines = study.measures(samples)
    written = study.write(samples, lines, _out_folder(args.out))
    return Shown([line(lines)], [asdict(each) for each in lines], written)


def wire(args: argparse.Namespace, loaded: LoadedConfig, progress: Progress) -> Shown:
    """The wire of the skin."""
    from cell.lab import wire as study
    from cell.tables import plain

    folder = _out_folder(args.out)
    seeds = range(args.seed, args.seed + (2 if args.quick else args.trials or 20))
    bar = progress.add_task("insertions", total=len(study.TRIED) * len(seeds))
    measures = study.measure(
        loaded.cell,
        seeds,
        args.workers or os.cpu_count() or 1,
        folder,
        args.quick,
        lambda row: progress.advance(bar),
    )
    data = {name: [asdict(line) for line in lines] for name, lines in measures.items()}
    (folder / "wire.json").write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")
    return Shown([plain(name, lines) for name, lines in measures.items()], data)


def tactile(args: argparse.Namespace, loaded: LoadedConfig, progress: Progress) -> Shown:
    """Reading the angle from the taxels."""
    from cell.lab import tactile_charts as study  # compiles; only when asked for
    from cell.tables import tactile

    found = study.run(loaded.cell, _out_folder(args.out), args.quick, progress)
    return Shown([tactile(found)], found.as_data())


def stability(args: argparse.Namespace, loaded: LoadedConfig, progress: Progress) -> Shown:
    """Where the loop through the skin goes unstable."""
    from cell.lab import stability_report as study  # compiles; only when asked for

    folder, workers = _out_folder(args.out), args.workers or os.cpu_count() or 1
    bar = progress.add_task("cases", total=study.cases(args.quick))
    found = study.run(loaded.cell, args.quick, workers, folder, lambda n: progress.advance(bar, n))
    return Shown([study.table(found)], found.data, found.files)


def frontier(args: argparse.Namespace, loaded: LoadedConfig, progress: Progress) -> Shown:
    """Speed against accuracy: presets, settings, and each step from the paper's method."""
    from cell.lab import frontier_charts as study
    from cell.tables import frontier

    seeds = range(args.seed, args.seed + (args.trials or (2 if args.quick else 40)))
    workers = args.workers or os.cpu_count() or 1
    found = study.run(args.config, args.set, seeds, workers, _out_folder(args.out), args.quick, progress)
    result = {"title": found.title, "lines": [asdict(line) for line in found.lines]}
    return Shown([frontier(found.lines, found.title)], _finite(result), found.files)


def events(args: argparse.Namespace, loaded: LoadedConfig, progress: Progress) -> Shown:
    """Hole events, false and true."""
    from cell.lab import events_report as study  # compiles; only when asked for

    config, trials = loaded.cell, args.trials or (4 if args.quick else 1000)
    if args.quick:
        config = config.with_params(SEARCH, timeout=min(config.params(SEARCH).timeout, 8.0))
    seeds = range(args.seed, args.seed + trials)
    workers = args.workers or os.cpu_count() or 1
    found = study.run(config, seeds, min(trials, 200), workers, _out_folder(args.out), progress)
    result = {"title": found.title, "lines": [asdict(line) for line in found.lines], "others": found.others}
    return Shown([study.table(found)], _finite(result), found.files)


def _finite(value: Any) -> Any:
    """Return the same with null for what JSON cannot say: a model that failed has no figure."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _out_folder(folder: Path) -> Path:
    """Return the folder that a study writes to, made if need be.

    Raises:
        ConfigError: It cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"--out {folder}: cannot be written: {error.strerror}") from None
    return folder


@dataclass(frozen=True, slots=True)
class Study:
    """One study, as the command line has it."""

    run: Callable[[argparse.Namespace, LoadedConfig, Progress], Shown]
    pace: str | None
    """Of the simulated cell where the config sets none."""


STUDIES = {
    "speed": Study(speed, "max"),
    "contact": Study(contact, "max"),
    "line": Study(line, None),
    "wire": Study(wire, "max"),
    "tactile": Study(tactile, None),
    "stability": Study(stability, "max"),
    "frontier": Study(frontier, "max"),
    "events": Study(events, "max"),
}
