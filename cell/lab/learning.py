"""Series of parts on one cell: its fixture moves slightly from part to part and is replaced at the end."""

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np

from cell.commands.arguments import out_folder
from cell.config.cell_config import CellConfig
from cell.devices.assembly import Cell, assemble, choices, make_perception, opened
from cell.film.drawing import COLOURS
from cell.lab.arguments import load_simulated, seeds_of
from cell.lab.charts import Curve, Panel, draw_panels
from cell.lab.report import StudyReport, reported
from cell.lab.rows import average, average_error, successes
from cell.lab.tables import SUCCESSES, Columns, table
from cell.lab.workers import each_of
from cell.peg.ending import ending_of
from cell.run.learning import Learning
from drivers.errors import CellError
from drivers.parts import HolePrior
from sim.config import FixtureConfig
from skills.catalogue import CATALOGUE
from skills.contract import Outcome, SkillContext

MOVES = 0.0005
"""Standard deviation of the hole's position between parts if the config names no fixture, m."""
WRONG = 0.0007
"""Stated standard deviation of a wrong prior, m: the precision of a learnt prior."""
EXCHANGED = 3
"""Number of parts before the fixture is replaced, divided by the number of parts afterwards."""
SERIES = 1000
"""Seed offset between two series."""


class Mode(StrEnum):
    """Prior knowledge of a cell about the hole's position."""

    LEARNS = "learns"
    PLAIN = "knows nothing"
    WRONG = "is told a wrong place"


@dataclass(frozen=True, slots=True)
class PartRow:
    """One part of a series; SI units."""

    mode: str
    seed: int
    """Seed of the series."""
    part: int
    """Number of the part in its series, starting at 1."""
    is_exchanged: bool
    """True if the fixture has been replaced."""
    is_expected: bool
    """True if the search began with an expected position."""
    outcome: str
    search_time: float
    total_time: float
    """Sum of search, insertion and adjustment time, s."""
    cycle_time: float
    """Time from the command to the end of the program, with transfers, grasp and release, s."""


def run_series(config: CellConfig, parts: int, mode: Mode, seed: int) -> list[PartRow]:
    """Return the parts of one series: first on a new cell, then on the same cell after a restart with another fixture.

    Args:
        config: The cell; its fixture moves by `MOVES` if the config has no value.
        parts: Number of parts before the fixture is replaced.
        mode: Knowledge of the hole's position.
        seed: Seed of the series.
    """
    rows: list[PartRow] = []
    with tempfile.TemporaryDirectory() as folder:
        learning = Learning(Path(folder), config.learning.model_copy(update={"place": mode is Mode.LEARNS}))
        for count, first in ((parts, SERIES * seed), (parts // EXCHANGED, SERIES * seed + SERIES // 2)):
            placed = _placed(config, mode, first)
            cell = assemble(placed)
            with opened(cell):
                ctx = cell.context(first)
                for number in range(count):
                    began = cell.clock.now()
                    outcome, times = _run_part(placed, cell, ctx, learning, number)
                    rows.append(
                        PartRow(
                            mode=mode,
                            seed=seed,
                            part=len(rows) + 1,
                            is_exchanged=len(rows) >= parts,
                            is_expected=ctx.job.hole.prior is not None,
                            outcome=outcome,
                            search_time=times["spray_search"],
                            total_time=sum(times.values()),
                            cycle_time=cell.clock.now() - began,
                        )
                    )
        learning.flush()
    return rows


def _placed(config: CellConfig, mode: Mode, first: int) -> CellConfig:
    """Return the cell with a fixture placed by the seed `first`; in the mode `WRONG`, its prior has a random mean in the area."""
    assert config.sim is not None
    sim = config.sim.model_copy(
        update={
            "seed": first,
            "pace": "max",
            "fixture": config.sim.fixture or FixtureConfig(deviation=MOVES),
        }
    )
    config = config.model_copy(update={"sim": sim})
    if mode is not Mode.WRONG:
        return config
    half = np.array(config.hole.area) / 2
    x, y = np.array(config.hole.centre[:2]) + np.random.default_rng(first).uniform(-half, half)
    prior = HolePrior(mean=(float(x), float(y)), deviation=(WRONG, WRONG))
    return config.model_copy(update={"hole": config.hole.model_copy(update={"prior": prior})})


def _run_part(
    config: CellConfig, cell: Cell, ctx: SkillContext, learning: Learning, number: int
) -> tuple[str, dict[str, float]]:
    """Insert part `number`, counted from 0, and learn from the insertion; return the outcome and the time of each counted stage, s."""
    assert config.sim is not None
    seed, times = config.sim.seed + number, dict.fromkeys(CATALOGUE.counted, 0.0)
    ctx.job = learning.prepared(config.job(slot=number % config.rack.slots), 0)
    ctx.rng, ctx.perception = choices(seed), make_perception(config)
    ctx.stage, ctx.lead.held = "", None
    cell.clear()
    cell.restock(ctx.job, seed)
    try:
        records = CATALOGUE["insert_peg"].run(config.skill_set(), ctx)
    except CellError:
        cell.arm.reset()
        return Outcome.FAULT, times
    learning.take(config.job(), 0, records)
    for record in records:
        if record.name in times:
            times[record.name] += record.result.elapsed
    return ending_of(records, None, "").outcome, times


@dataclass(frozen=True, slots=True)
class PartLine:
    """All series of one mode over one range of parts."""

    mode: str
    parts: str
    trials: int
    successes: int
    expected: int
    """Number of searches that began with an expected position."""
    search: float
    """Mean time of the search of successes, s."""
    total: float
    """Mean total time of successes, s."""
    total_error: float
    """Half the 95 % interval of that mean, s."""
    cycle: float
    """Mean time of the whole cycle of successes, s."""


def lines_of(rows: Sequence[PartRow], parts: int) -> list[PartLine]:
    """Return mean times by mode: for parts 1 and 2, for later parts, of which the position can be learnt, and with another fixture."""
    stretches = (("1 to 2", 1, 2), (f"3 to {parts}", 3, parts), ("other fixture", parts + 1, 10**9))
    lines = []
    for mode in Mode:
        for name, low, high in stretches:
            of = [row for row in rows if row.mode == mode and low <= row.part <= high]
            good = successes(of)
            totals = [row.total_time for row in good]
            lines.append(
                PartLine(
                    mode=mode,
                    parts=name,
                    trials=len(of),
                    successes=len(good),
                    expected=sum(row.is_expected for row in of),
                    search=average([row.search_time for row in good]),
                    total=average(totals),
                    total_error=average_error(totals),
                    cycle=average([row.cycle_time for row in good]),
                )
            )
    return lines


def panels(rows: Sequence[PartRow], parts: int) -> list[Panel]:
    """Return mean search and total time of the successes by number of the part."""
    found = []
    for name, what in (("search_time", "search"), ("total_time", "search, insertion and adjustment")):
        curves = []
        for mode, colour in zip(Mode, COLOURS[1:], strict=False):
            good = [row for row in rows if row.mode == mode and row.outcome == Outcome.SUCCESS]
            numbers = sorted({row.part for row in good})
            means = [float(np.mean([getattr(row, name) for row in good if row.part == part])) for part in numbers]
            curves.append(Curve(numbers, means, colour, f"the cell {mode}", "o-"))
        label = "number of the part; dashed: another fixture"
        found.append(
            Panel(what, label, "mean time of successes (s)", curves, y_limits=(0.0, None), marks=(parts + 0.5,))
        )
    return found


def run(args: argparse.Namespace) -> StudyReport:
    """Run every series, write the table, draw the chart."""
    config, folder = load_simulated(args).cell, out_folder(args.out)
    parts, seeds = args.parts or (3 if args.quick else 20), seeds_of(args, 10)
    jobs = [(config, parts, mode, seed) for mode in Mode for seed in seeds]
    rows = [row for series in each_of(run_series, jobs, args.workers, "series") for row in series]
    lines = lines_of(rows, parts)
    title = (
        f"{len(seeds)} series of {parts} parts and {parts // EXCHANGED} of another fixture, seeds {seeds[0]} to"
        f" {seeds[-1]}, reality {config.reality.scale:g}"
    )
    columns: Columns = {
        **SUCCESSES,
        "with a place": lambda line: f"{line.expected}/{line.trials}",
        "search (s)": lambda line: f"{line.search:.2f}",
        "total (s, 95 %)": lambda line: f"{line.total:.2f} ± {line.total_error:.2f}",
        "cycle (s)": lambda line: f"{line.cycle:.2f}",
    }
    names: Columns = {"the cell": lambda line: line.mode, "parts": lambda line: line.parts}
    shown = table(title, names, columns, lines, "times are means of the successes")
    chart = draw_panels(panels(rows, parts), title, folder / "learning.png")
    return reported(shown, folder, {"parts.csv": rows}, [chart], title=title, lines=lines, rows=rows)
