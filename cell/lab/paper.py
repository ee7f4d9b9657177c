"""The published method under honest errors, in a laboratory that reproduces its figures, judged as in [gibbons].

The figures that [gibbons] does not print were fitted once, on seeds that the judgement does not use; docs/tried/paper.md
describes the fit. The figures of the method are in the preset `paper`, those of the laboratory in variants.toml.
"""

import argparse

from cell.lab.arguments import load_simulated, seeds_of
from cell.lab.charts import draw_speed_accuracy
from cell.lab.compare import chosen, compared, section
from cell.lab.published import PUBLISHED, Tried, stage_table
from cell.lab.report import StudyReport, reported
from cell.lab.tables import stages
from cell.lab.trials import VOID, TrialRow

SEARCH = PUBLISHED[0].name
NEAR = 8.1e-3
"""Largest distance of the peg's end from the hole's axis for a correct detection, m; the edge in the hole leads the end
by up to 4 mm."""


def tried(row: TrialRow) -> Tried:
    """Return a trial judged as in [gibbons]: by the switch; a false detection is a failure of the search."""
    times = row.tried().times
    if row.found_error is not None and row.found_error > NEAR:
        return Tried(False, SEARCH, {SEARCH: times[SEARCH]} if SEARCH in times else {})
    return Tried(row.switch_closed and row.outcome != VOID, row.stage, times)


def run(args: argparse.Namespace) -> StudyReport:
    """Run the method, write its stages next to those of [gibbons], Table I, and draw success against time."""
    other_half = 500  # Offset from --seed to the first seed; the fit used the seeds before it.
    load_simulated(args)
    seeds = seeds_of(args, section(args.name)["trials"])
    seeds = range(seeds.start + other_half, seeds.stop + other_half)
    found = compared(args, chosen(args.name, args.quick), seeds)
    trials = [tried(row) for row in found.rows[0]]
    lines = stage_table(trials)
    shown = stages(lines, [sum(each.times.values()) for each in trials if each.succeeded])
    chart = draw_speed_accuracy(lines[-1], found.folder / "paper.png")
    error = found.lines[0].error
    return reported(shown, found.folder, {"paper.csv": lines}, [chart], title=found.title, stages=lines, error=error)
