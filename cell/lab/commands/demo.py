"""`cell demo`: the main job on the embedded default, requested by a PLC peer."""

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from cell.commands.arguments import add_config, add_journal, folder_path, open_journal, out_folder, positive
from cell.commands.terminal import GOOD, NOT_GOOD, say, show
from cell.lab.arguments import load_simulated, working

if TYPE_CHECKING:
    from plc_bridge.protocol.messages import Report


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the number of insertions, and the folder of records and pictures."""
    add_config(parser)
    add_journal(parser)
    parser.add_argument(
        "--trials", type=positive, default=5, metavar="N", help="insertions that the peer asks for; default 5"
    )
    parser.add_argument(
        "--out",
        type=folder_path,
        default=Path("out/demo"),
        metavar="DIR",
        help="folder for the pictures; default out/demo",
    )


def run(args: argparse.Namespace) -> int:
    """Run the insertions, draw one of them and the chart; return GOOD if all succeeded."""
    from cell.commands import words
    from cell.lab.demo import draw_demo, run_demo
    from cell.lab.published import stage_table
    from cell.lab.rows import known, successes
    from cell.lab.tables import stages
    from skills.contract import Outcome

    loaded = load_simulated(args)
    folder = out_folder(args.out)
    with open_journal(args, loaded.cell.journal) as journal, working() as bars:
        bar = bars.add_task("insertions", total=args.trials)

        def watch(done: int, report: "Report") -> None:
            stage = words.report(report)["stage"] or "waiting"
            bars.update(bar, completed=done, description=f"insertions: {stage}")

        result = run_demo(loaded, journal, args.trials, watch, args.stop)
        is_whole = len(result.reports) == args.trials
        pictures = draw_demo(result, journal, folder) if is_whole else []
    lines = stage_table(result.tried())
    results = list(map(words.report, result.reports))
    data = {"results": results, "stages": list(map(asdict, lines)), "pictures": list(map(str, pictures))}
    show(args, stages(lines, known(row.cycle_time for row in successes(result.rows))), data)
    if not args.json:
        for row in result.rows:
            say(f"run {row.run}: {row.outcome} {row.stage} {row.reason}".rstrip())
        say("pictures:", *pictures if is_whole else ["none, because the demo was stopped"])
        say("next: cell serve --page, then open the page whose address it prints")
    return GOOD if is_whole and all(r["result"] == Outcome.SUCCESS for r in results) else NOT_GOOD
