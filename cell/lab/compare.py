"""Studies that compare variants of the cell on the same seeds: the variants of variants.toml, and how they are run."""

import argparse
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from cell.commands.arguments import out_folder, require_known
from cell.config.cell_config import CellConfig
from cell.lab.arguments import advancing, load_simulated, seeds_of
from cell.lab.charts import Bar, draw_rows
from cell.lab.frontier.measure import FrontierLine, Variant, measure, title_of
from cell.lab.rate_test import RateTest
from cell.lab.report import StudyReport, finite
from cell.lab.rows import average, average_error, quantile, write_rows
from cell.lab.tables import TURNS, VARIANTS, Columns, table
from cell.lab.trials import TABLE, TrialRow, read_table
from skills.contract import Outcome

FILE = Path(__file__).parent / "variants.toml"
NAMES: Columns = {"variant": lambda line: line.family}


@dataclass(frozen=True, slots=True)
class Compared:
    """Results of variants on the same seeds."""

    lines: Sequence[FrontierLine]
    rows: Sequence[Sequence[TrialRow]]
    """Trials of each line, sorted by seed."""
    title: str
    folder: Path

    def bars(self) -> list[Bar]:
        """Return the lines for a chart."""
        return [
            Bar(
                *(line.family, line.variant or "trials", line.successes, line.trials),
                *(line.mean, line.mean_error),
                *(line.force_median, line.force_p95),
            )
            for line in self.lines
        ]


def section(study: str) -> dict[str, Any]:
    """Return the data of a study in variants.toml."""
    found: dict[str, Any] = tomllib.loads(FILE.read_text(encoding="utf-8"))[study]
    return found


def variants_of(study: str) -> list[Variant]:
    """Return the variants of a study."""
    data = section(study)
    probe = resolve_name(data.get("probe", "cell.lab.trials:no_probe"))
    return [
        Variant(each["family"], "", each.get("preset"), (*data.get("common", ()), *each.get("sets", ())), probe=probe)
        for each in data["variant"]
    ]


def chosen(study: str, is_quick: bool, families: Sequence[str] = (), option: str = "--only") -> list[Variant]:
    """Return the variants of the families that `option` names, of those for --quick, or all.

    Raises:
        ConfigError: A family is unknown.
    """
    found = variants_of(study)
    known = dict.fromkeys(variant.family for variant in found)
    for name in families:
        require_known(option, name, known)
    wanted = families or (section(study)["quick"] if is_quick else known)
    return [variant for variant in found if variant.family in wanted]


def compared(
    args: argparse.Namespace,
    tried: Sequence[Variant],
    seeds: range,
    tests: Mapping[str, RateTest] | None = None,
    of_each: str = "",
) -> Compared:
    """Run every variant on the same seeds; finished trials in the folder of --out are reused."""
    folder = out_folder(args.out)
    with advancing("trials", len(tried) * len(seeds)) as done:
        lines = measure(args.config, args.set, tried, seeds, args.workers, folder, done, tests)
    rows = [read_table(folder / line.folder / TABLE) if line.trials else [] for line in lines]
    return Compared(lines, rows, title_of(seeds, of_each), folder)


def beside_first(found: Compared) -> Columns:
    """Return columns that compare each line with the first: the difference of time on the seeds that both inserted, its median and its mean
    with the 95 % half width, s, and the median computing time of a simulated second, ms.
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


def _times(rows: Sequence[TrialRow]) -> dict[int, float]:
    return {row.seed: row.total_time for row in rows if row.outcome == Outcome.SUCCESS and row.total_time is not None}


def config_of(args: argparse.Namespace) -> CellConfig:
    """Return the simulated cell of --config and --set."""
    return load_simulated(args, f"study {args.name}").cell


def run(args: argparse.Namespace) -> StudyReport:
    """Run the variants of the study, write their table, and draw success, time and force."""
    config_of(args)
    tried = chosen(args.name, args.quick, args.only)
    found = compared(args, tried, seeds_of(args, section(args.name)["trials"]))
    files = [
        write_rows(found.lines, found.folder / f"{args.name}.csv"),
        draw_rows(found.bars(), found.title, found.folder / f"{args.name}.png"),
    ]
    result = {"title": found.title, "lines": [asdict(line) for line in found.lines]}
    return StudyReport(
        [table(found.title, NAMES, {**beside_first(found), **VARIANTS, **TURNS}, found.lines)], finite(result), files
    )
