"""Variants of the cell on the same seeds: their trials and summary; also the study of the stand-in's models."""

import argparse
import logging
import math
import platform
import re
import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import numpy as np

from cell.commands.arguments import out_folder, require_known
from cell.config.load import load
from cell.lab.arguments import advancing, load_simulated, seeds_of
from cell.lab.rate_test import LevelTest
from cell.lab.report import StudyReport, reported
from cell.lab.rows import average, average_error, known, quantile, successes, write_rows
from cell.lab.tables import TURNS, VARIANTS, Columns, table
from cell.lab.trials import MakeProbe, Probe, Program, TrialRow, insert_peg, run_trials
from cell.records.provenance import versions
from cell.records.statistics import wilson
from drivers.errors import CellError
from sim.world.metering import OVER_FORCE
from skills.contract import Outcome

logger = logging.getLogger(__name__)

NAMES: Columns = {"variant": lambda line: line.family}


@dataclass(frozen=True, slots=True)
class Variant:
    """One variant of the cell."""

    family: str
    """Group of variants: a curve, or one variant alone."""
    name: str = ""
    preset: str | None = None
    """Preset that replaces the config's own; None keeps the config's."""
    sets: tuple[str, ...] = ()
    """Single keys, `KEY=VALUE`, on top of the preset."""
    probe: MakeProbe = Probe
    """Function that prepares each trial and returns its probe."""
    program: Program = insert_peg
    """Program of the variant's trials."""

    @property
    def folder(self) -> str:
        """Name of the folder of the variant's trials."""
        return re.sub(r"\W+", "-", f"{self.family} {self.name}").strip("-")


@dataclass(frozen=True, slots=True)
class VariantLine:
    """Result of one variant; times are over its successes, s, and NaN if there are no successes."""

    family: str
    variant: str
    preset: str
    sets: str
    """Keys that differ from the preset, separated by spaces."""
    folder: str
    trials: int
    successes: int
    low: float
    """Lower end of the Wilson 95 % interval of the success rate."""
    high: float
    mean: float
    """Mean of the total time, search + insertion + adjustment, s."""
    median: float
    p95: float
    force_median: float
    """Median of the largest contact force over all trials, N."""
    within: int
    """Number of trials whose largest contact force is at most `OVER_FORCE`."""
    theta: float
    """Median over all trials of the root mean square error of theta, rad."""
    tip: float
    """Median over all trials of the root mean square error of the tip's position, m."""
    turn_median: float
    """Median of the peg's largest rotation in the hand over all trials, rad."""
    turn_p95: float
    endings: str
    """Endings other than success, with their counts."""
    error: str
    """Reason why the variant did not run; empty if it ran."""
    verdict: str
    """Result of the test that ended the trials; empty without one."""


@dataclass(frozen=True, slots=True)
class Compared:
    """Results of variants on the same seeds."""

    lines: Sequence[VariantLine]
    rows: Sequence[Sequence[TrialRow]]
    """Trials of each line, sorted by seed."""
    title: str
    """Trials, seeds and versions, for charts and tables."""
    folder: Path


def section(study: str) -> dict[str, Any]:
    """Return the data of a study in variants.toml."""
    found: dict[str, Any] = tomllib.loads(Path(__file__).with_name("variants.toml").read_text(encoding="utf-8"))[study]
    return found


def chosen(study: str, is_quick: bool, families: Sequence[str] = (), option: str = "--only") -> list[Variant]:
    """Return the variants of `families`, which the user gave with `option`; if there are none, those for --quick, or all.

    Raises:
        ConfigError: A family is unknown.
    """
    data = section(study)
    probe, common = resolve_name(data.get("probe", "cell.lab.trials:Probe")), data.get("common", ())
    found = {
        each["family"]: Variant(
            each["family"], each.get("name", ""), each.get("preset"), (*common, *each.get("sets", ())), probe
        )
        for each in data["variant"]
    }
    for name in families:
        require_known(option, name, found)
    return [found[name] for name in found if name in (families or (data["quick"] if is_quick else found))]


def compared(
    args: argparse.Namespace,
    tried: Sequence[Variant],
    seeds: range,
    table: str = "variants.csv",
    test: LevelTest | None = None,
) -> Compared:
    """Run every variant on the same seeds; finished trials in the folder of --out are reused.

    If a variant does not run, its line contains the error, and the others continue.

    Args:
        args: Options of the study.
        tried: Variants to run.
        seeds: Seeds, one trial each, for every variant.
        table: Name of the CSV file of the lines; after an interrupted call it contains the lines of the finished variants.
        test: Test that can end a variant's trials before the last seed; None runs every seed.
    """
    folder = out_folder(args.out)
    lines, found = list[VariantLine](), list[list[TrialRow]]()

    with advancing("trials", len(tried) * len(seeds)) as done:
        for variant in tried:
            rows, trouble = list[TrialRow](), ""
            try:
                rows = run_trials(
                    load(args.config, variant.preset, [*args.set, *variant.sets, "sim.pace=max"]).cell,
                    seeds,
                    args.workers,
                    folder / variant.folder,
                    lambda row: done(1),
                    getattr(args, "scheduler", None),
                    None if test is None else test.is_answered,
                    variant.probe,
                    variant.program,
                )
            except CellError as error:
                trouble = str(error)
            except Exception as error:  # any error: the results of the other variants are still useful
                logger.exception("%s", variant.folder)
                trouble = " ".join(f"{type(error).__name__}: {error}".split())
            done(len(seeds) - len(rows))
            lines.append(_line(variant, rows, trouble, test.of(rows) if test is not None and rows else ""))
            found.append(rows)
            write_rows(lines, folder / table)
    return Compared(lines, found, _title(lines, seeds), folder)


def _title(lines: Sequence[VariantLine], seeds: range) -> str:
    counts = sorted({line.trials for line in lines if not line.error}) or [0]
    number = f"{counts[0]} to {counts[-1]}" if len(counts) > 1 else f"{counts[0]}"
    return (
        f"{number} trials a variant, simulated, seeds {seeds[0]} to {seeds[-1]}; python {platform.python_version()}, "
        + ", ".join(f"{name} {versions()[name]}" for name in ("mujoco", "numpy", "code"))
    )


def _line(variant: Variant, rows: Sequence[TrialRow], trouble: str, verdict: str) -> VariantLine:
    good = successes(rows)
    totals, forces = known(row.total_time for row in good), [row.peak_contact_force for row in rows]
    turns = [row.max_in_hand_rotation for row in rows]
    low, high = wilson(len(good), len(rows))
    endings = Counter(
        " ".join(f"{row.outcome} {row.stage} {row.reason}".split()) for row in rows if row.outcome != Outcome.SUCCESS
    )
    return VariantLine(
        family=variant.family,
        variant=variant.name,
        preset=variant.preset or "",
        sets=" ".join(variant.sets),
        folder=variant.folder,
        trials=len(rows),
        successes=len(good),
        low=low,
        high=high,
        mean=average(totals),
        median=quantile(totals, 0.5),
        p95=quantile(totals, 0.95),
        force_median=quantile(forces, 0.5),
        within=int(np.count_nonzero(np.array(forces) <= OVER_FORCE)),
        theta=quantile(known(row.theta_rmse for row in rows), 0.5),
        tip=quantile(known(row.tip_rmse for row in rows), 0.5),
        turn_median=quantile(turns, 0.5),
        turn_p95=quantile(turns, 0.95),
        endings=", ".join(f"{count} x {text}" for text, count in endings.most_common()),
        error=trouble,
        verdict=verdict,
    )


def beside_first(found: Compared) -> Columns:
    """Return columns that compare each line with the first line.

    The columns are the median, and the mean with its 95 % half width, of the difference of time on the seeds that both inserted, s; and
    the median computing time of a simulated second, ms.
    """
    first = _times(found.rows[0])
    longer, costs = {}, {}
    for line, rows in zip(found.lines, found.rows, strict=True):
        times = _times(rows)
        more = [times[seed] - first[seed] for seed in times.keys() & first.keys()]
        told = f"{quantile(more, 0.5):+.2f}; {average(more):+.2f} ± {average_error(more):.2f}"
        longer[line] = told if more and rows is not found.rows[0] else ""
        costs[line] = f"{1e3 * quantile([row.wall_time / row.sim_time for row in rows], 0.5):.0f}"
    return {"median; mean beside the first (s)": lambda line: longer[line], "ms/s": lambda line: costs[line]}


def _times(rows: Sequence[TrialRow]) -> Mapping[int, float]:
    return {row.seed: row.total_time or math.nan for row in successes(rows)}


def run(args: argparse.Namespace) -> StudyReport:
    """Run the variants of the stand-in, and write their table."""
    load_simulated(args)
    tried = chosen(args.name, args.quick, args.only)
    found = compared(args, tried, seeds_of(args, section(args.name)["trials"]), f"{args.name}.csv")
    shown = table(found.title, NAMES, {**beside_first(found), **VARIANTS, **TURNS}, found.lines)
    return reported(shown, found.folder, {f"{args.name}.csv": found.lines}, title=found.title, lines=found.lines)
