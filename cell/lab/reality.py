"""Cost of a cell's errors: each alone and all combined, or with --rows named errors of one stated size.

An error alone runs at growing scales, up to the first at which a sequential test finds too many losses.
"""

import argparse
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cell.commands.arguments import out_folder
from cell.config.cell_config import CellConfig
from cell.config.files import ERRORS_FILE, SHIPPED
from cell.lab.arguments import seeds_of
from cell.lab.charts import draw_rows
from cell.lab.compare import NAMES, Compared, compared, config_of, section
from cell.lab.frontier.measure import FRONTIER, FrontierLine, Variant
from cell.lab.report import StudyReport, finite
from cell.lab.rows import write_rows
from cell.lab.tables import VARIANTS, table
from cell.lab.trials import TrialRow
from cell.records.statistics import RateTest, Verdict
from drivers.arm.kinematics import finger_frame, jacobian, links
from drivers.quantities import Vector
from sim.world.reality import KINDS, AnyError, Figure, read
from skills.contract import Outcome

ALL = "all together"
SCALES: dict[bool, tuple[float, ...]] = {False: (1.0, 2.0, 4.0, 8.0), True: (2.0,)}
"""Scales of each single error, up to the first with losses; a quick study has fewer."""
TOGETHER: dict[bool, tuple[float, ...]] = {False: (0.0, 1.0, 2.0, 3.0), True: (0.0, 1.0)}
"""Scales of all errors combined."""
BINS = 4
"""Number of groups of equal size for the trials, sorted by the size of one error."""
TEST = RateTest(good=0.02, bad=0.15)
"""Test that ends the trials of a single error: an error that costs at most the share `good` is tolerable. Without a
loss it ends after 21 trials."""


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Largest tolerable size of one error."""

    error: str
    about: str
    unit: str
    scale: float
    """Largest tested scale with no more losses than without the error; 0 if the smallest already has too many."""
    size: str
    """Size of the error at that scale, in its unit."""
    beyond: str
    """Size at the next larger scale, which has too many losses; empty if every tested scale is tolerable."""
    lost: str
    """Successes of the trials at that scale, and at the next larger one."""


@dataclass(frozen=True, slots=True)
class Rank:
    """Share of the variance among trials with all errors that the size of one error explains."""

    error: str
    time: float
    """Share of the variance of the total time of successes."""
    force: float
    """Share of the variance of the largest contact force."""


def errors_of(config: CellConfig) -> Mapping[str, AnyError]:
    """Return the errors of the cell by name.

    Raises:
        ConfigError: The file is invalid.
    """
    return read(config.reality.file or SHIPPED / ERRORS_FILE).errors


def together(is_quick: bool) -> list[Variant]:
    """Return the variants with all errors, at several scales."""
    return [Variant(ALL, f"{s:g}", None, (f"reality.scale={s:g}", 'reality.alone=""')) for s in TOGETHER[is_quick]]


def alone(names: Iterable[str], scale: float) -> list[Variant]:
    """Return the variants with each of these errors alone, at one scale."""
    return [
        Variant(name, f"{scale:g}", None, (f"reality.scale={scale:g}", f'reality.alone="{name}"')) for name in names
    ]


def drawn_alone(errors: Mapping[str, AnyError], is_quick: bool) -> list[str]:
    """Return the names of the single errors to test: those with an effect of their own, in a quick study two of them."""
    names = [name for name in errors if not KINDS[name].part_of]
    return names[:2] if is_quick else names


def still_borne(lines: Sequence[FrontierLine]) -> list[str]:
    """Return the names of the errors in these lines that are tolerable alone at all of their scales."""
    names = dict.fromkeys(line.family for line in lines if line.family != ALL)
    return [name for name in names if all(is_borne(line) for line in lines if line.family == name)]


def size_at(error: AnyError, scale: float) -> str:
    """Return the size of an error at a scale, in its unit: its bounds, or three standard deviations for a normal one."""
    figures = {key: np.asarray(value, dtype=float) for key, value in error.figures().items()}
    if error.distribution == "normal":
        return f"±{_told(3.0 * scale * figures['sigma'])}"
    if error.distribution == "uniform":
        return f"{_told(scale * figures['low'])} to {_told(scale * figures['high'])}"
    if error.distribution == "factor":
        return f"x 1/{_told(figures['spread'] ** scale)} to {_told(figures['spread'] ** scale)}"
    if error.distribution == "lognormal":
        return f"x 1/{_told(np.exp(3.0 * scale * figures['sigma']))} to {_told(np.exp(3.0 * scale * figures['sigma']))}"
    return f"{100.0 * min(scale * float(figures['probability']), 1.0):.3g} %"


def tolerances(errors: Mapping[str, AnyError], lines: Sequence[FrontierLine]) -> list[Tolerance]:
    """Return the tolerance of each single error: up to the first scale at which the test finds too many losses."""
    sheet = []
    for name, error in errors.items():
        tried = [line for line in lines if line.family == (KINDS[name].part_of or name) and line.trials]
        good = 0
        while good < len(tried) and is_borne(tried[good]):
            good += 1
        scale = float(tried[good - 1].variant) if good else 0.0
        seen = [f"{line.successes}/{line.trials} at {line.variant}" for line in tried[max(good - 1, 0) : good + 1]]
        beyond = size_at(error, float(tried[good].variant)) if good < len(tried) else ""
        if tried:
            sheet.append(
                Tolerance(name, error.about, error.unit, scale, size_at(error, scale), beyond, ", ".join(seen))
            )
    return sheet


def is_borne(line: FrontierLine) -> bool:
    """Return True if the test does not find too many losses; a variant that did not run is not tolerable."""
    return line.trials > 0 and TEST.verdict(line.trials - line.successes, line.trials) is not Verdict.BAD


def ranking(errors: Mapping[str, AnyError], rows: Sequence[TrialRow]) -> list[Rank]:
    """Return the share of the variance of time and force that each recorded error explains alone, the largest first.

    The first-order share Var(E[y | x]) / Var(y), the inner mean over groups of equal size, minus the share expected by
    chance (omega squared: Hays 1963). Noise remains; with 40 trials, shares below 0.1 are not significant.
    """
    found = []
    for name in errors:
        key = f"reality.{name}"
        told = [row for row in rows if key in row.more]
        if len(told) < 2 * BINS:
            continue
        size = np.array([_deviation(name, row.more[key]) for row in told])
        time = np.array([row.total_time if row.outcome == Outcome.SUCCESS else math.nan for row in told], dtype=float)
        force = np.array([row.peak_contact_force for row in told])
        found.append(Rank(name, _explained(size, time), _explained(size, force)))
    return sorted(found, key=lambda rank: -max(rank.time, rank.force))


def _deviation(name: str, text: str) -> float:
    """Return the size of a drawn error: its root mean square, or that of its logarithm for a factor."""
    values = np.array([float(word) for word in text.split()])
    ideal = KINDS[name].ideal
    away = np.log(values) if ideal == 1.0 else values - ideal
    # The sign of a single value can matter; several values are summarised by their size.
    return float(away[0]) if len(away) == 1 else float(np.sqrt((away**2).mean()))


def _explained(size: Vector, value: Vector) -> float:
    known = np.isfinite(value)
    size, value = size[known], value[known]
    total = float(((value - value.mean()) ** 2).sum()) if len(value) else 0.0
    if len(value) < 2 * BINS or total == 0.0 or np.ptp(size) == 0.0:
        return 0.0
    groups = np.array_split(value[np.argsort(size, kind="stable")], BINS)
    between = sum(len(group) * (group.mean() - value.mean()) ** 2 for group in groups)
    within = (total - between) / (len(value) - BINS)
    return max(float((between - (BINS - 1) * within) / (total + within)), 0.0)


def _told(figures: Vector) -> str:
    values = np.unique(figures)
    return f"{values[0]:.3g}" if len(values) == 1 else f"{values[0]:.3g}..{values[-1]:.3g}"


def named_rows(config: CellConfig, folder: Path, is_quick: bool) -> list[Variant]:
    """Return a variant for each named error of variants.toml, with its file of errors in `folder`."""
    errors, found = errors_of(config), []
    rows = section("rows")["row"]
    for row in rows[:2] if is_quick else rows:
        file = folder / "errors" / (re.sub(r"\W+", "-", row["name"]).strip("-") + ".toml")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(errors_file(errors, figures_of(row, config)), encoding="utf-8")
        keys = ("reality.scale=1", 'reality.alone=""', f"reality.file={json.dumps(str(file.resolve()))}")
        found.append(Variant(row["name"], "", row.get("preset"), (*row.get("sets", ()), *keys)))
    return found


def figures_of(row: Mapping[str, Any], config: CellConfig) -> dict[str, Figure]:
    """Return the size of each error of a row by name; a force becomes the joint torques that produce it above the hole."""
    figures: dict[str, Figure] = {
        name: tuple(value) if isinstance(value, list) else value for name, value in row.get("figures", {}).items()
    }
    if "force" in row:
        torques = joint_torques(config, np.array(row["force"]))
        figures["arm.wrench_torque"] = tuple(float(torque) for torque in torques)
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


def run(args: argparse.Namespace) -> StudyReport:
    """Run every error alone and all combined on the same seeds, write the tables, draw the chart."""
    config = config_of(args)
    if args.rows:
        return _run_rows(args, config)
    seeds, errors = seeds_of(args, 40), errors_of(config)
    tried, going = together(args.quick), drawn_alone(errors, args.quick)
    tests = dict.fromkeys(going, TEST)
    for scale in SCALES[args.quick]:
        tried = [*tried, *alone(going, scale)]
        # Finished trials of earlier scales are reused from the folder.
        found = compared(args, tried, seeds, tests, f"at most {len(seeds)}")
        going = still_borne(found.lines)
    sheet = tolerances(errors, found.lines)
    ranks = ranking(errors, [row for line, rows in _pairs(found) if _is_honest(line) for row in rows])
    files = [
        found.folder / FRONTIER,
        draw_rows(found.bars(), f"What errors of the cell cost\n{found.title}", found.folder / "reality.png"),
    ]
    result = {
        "title": found.title,
        "lines": [asdict(line) for line in found.lines],
        "tolerances": [asdict(line) for line in sheet],
        "ranking": [asdict(line) for line in ranks],
    }
    shown = [
        table(found.title, NAMES, VARIANTS, found.lines),
        table(
            "Each error alone may be so large",
            {"error": lambda line: line.error, "what it is": lambda line: line.about},
            {
                "borne": lambda line: line.size,
                "too much": lambda line: line.beyond,
                "unit": lambda line: line.unit,
                "scale": lambda line: f"{line.scale:g}",
                "successes": lambda line: line.lost,
            },
            sheet,
        ),
        table(
            "Share of the variance explained by the size of each error, all together at scale 1",
            {"error": lambda rank: rank.error},
            {"of the time": lambda rank: f"{rank.time:.2f}", "of the force": lambda rank: f"{rank.force:.2f}"},
            ranks,
        ),
    ]
    return StudyReport(shown, finite(result), files)


def _pairs(found: Compared) -> Iterable[tuple[FrontierLine, Sequence[TrialRow]]]:
    return zip(found.lines, found.rows, strict=True)


def _is_honest(line: FrontierLine) -> bool:
    return line.family == ALL and line.variant == "1"


def _run_rows(args: argparse.Namespace, config: CellConfig) -> StudyReport:
    """Run the named errors on the same seeds and write their table."""
    seeds = seeds_of(args, 12)
    tried = named_rows(config, out_folder(args.out), args.quick)
    found = compared(args, tried, seeds, dict.fromkeys((each.family for each in tried), TEST), f"at most {len(seeds)}")
    file = write_rows(found.lines, found.folder / "rows.csv")
    result = {"title": found.title, "rows": [asdict(line) for line in found.lines]}
    shown = table(found.title, {"error": lambda line: line.family}, VARIANTS, found.lines)
    return StudyReport([shown], finite(result), [file])
