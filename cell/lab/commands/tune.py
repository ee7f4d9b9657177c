"""`cell tune`: a recipe that fulfils a wish for time, force and success, with its evidence."""

import argparse
import os
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from cell.commands.arguments import add_config, folder_path, natural, out_folder, positive
from cell.commands.terminal import GOOD, NOT_GOOD, complain, show, written
from cell.lab.arguments import load_simulated, working
from drivers.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.table import Table

    from cell.lab.trials import TrialRow
    from cell.lab.tune.measure import Candidate, Space

RECIPE = "recipe.toml"
AWAY = 1_000_000
"""Distance between the seeds for the choice of settings and the seeds for judging the best one."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the wish, the effort, and the output file of the recipe."""
    add_config(parser)
    parser.add_argument(
        "--want", required=True, metavar="WISH", help='as in "p95<=8 s, force<=20 N, success>=98 %%"; mean<= as well'
    )
    parser.add_argument(
        "--method", metavar="NAME", help="method of `cell study frontier` to tune; default the cell's own"
    )
    parser.add_argument("--scene", metavar="NAME", help="scene of --method; default its first")
    parser.add_argument("--candidates", type=positive, default=18, metavar="N", help="settings to try; default 18")
    parser.add_argument(
        "--trials", type=positive, default=16, metavar="N", help="insertions by each setting at most; default 16"
    )
    parser.add_argument(
        "--judge",
        type=positive,
        default=60,
        metavar="N",
        help="insertions by the best setting, on other seeds; default 60",
    )
    parser.add_argument("--seed", type=natural, default=1, metavar="S", help="seed of the first trial; default 1")
    parser.add_argument(
        "--workers",
        type=positive,
        default=os.cpu_count() or 1,
        metavar="N",
        help="number of processes; default one for each core",
    )
    parser.add_argument("--out", type=folder_path, required=True, metavar="DIR")


def run(args: argparse.Namespace) -> int:
    """Search, judge, write the recipe; NOT_GOOD with the result reached if the wish is not fulfilled."""
    from cell.lab.tune import measure
    from cell.lab.tune.wish import wishes_of

    wishes = wishes_of(args.want)
    load_simulated(args, "tune")
    space = _space(args)
    folder, seeds = out_folder(args.out), range(args.seed, args.seed + args.trials)
    with working() as bars:
        bar = bars.add_task("settings", total=args.candidates * len(seeds))
        tried = measure.tune(
            space, wishes, seeds, args.candidates, args.workers, folder, lambda count: bars.advance(bar, count)
        )
        best = tried[0]
        bar = bars.add_task("judging", total=args.judge)
        fresh = range(args.seed + AWAY, args.seed + AWAY + args.judge)
        rows = measure.judge(space, best, fresh, args.workers, folder / "judged", lambda row: bars.advance(bar))
    evidence = [(wish.text, wish.found(rows), wish.holds(rows)) for wish in wishes]
    is_good = all(holds for _, _, holds in evidence)
    recipe = folder / RECIPE
    recipe.write_text(_recipe(args.want, best, tried, evidence, rows), encoding="utf-8")
    show(args, _table(evidence, best), _data(best, tried, evidence, is_good, recipe))
    written(args, [recipe])
    if not is_good:
        nearest = "; ".join(f"{wish}: {found}" for wish, found, _ in evidence)
        complain(f"--want {args.want}: not fulfilled by any of {len(tried)} settings; nearest: {nearest}")
    return GOOD if is_good else NOT_GOOD


def _space(args: argparse.Namespace) -> "Space":
    """Return the settings to choose from.

    Raises:
        ConfigError: A method or scene is unknown, or a scene has no method.
    """
    from cell.lab.frontier.methods import METHODS, SCENES, require_methods
    from cell.lab.tune.measure import Space

    if args.method is None:
        if args.scene is not None:
            raise ConfigError(f"--scene {args.scene}: needs --method")
        return Space(args.config, args.set)
    scene = args.scene or next(iter(SCENES))
    require_methods([args.method], [scene])
    return METHODS[args.method].space(scene, args.config, args.set)


def _recipe(
    want: str,
    best: "Candidate",
    tried: "Sequence[Candidate]",
    evidence: "Sequence[tuple[str, str, bool]]",
    rows: "Sequence[TrialRow]",
) -> str:
    from cell.lab.tune.measure import toml
    from cell.records.provenance import versions

    seeds = [row.seed for row in rows]
    lines = [
        f"Wished: {want}. Found by `cell tune` on {datetime.now(UTC):%Y-%m-%d}, code {versions()['code']},",
        f"among {len(tried)} settings. A section is between the presets (0 careful, 1 balanced, 2 fast): {_figures(best)}.",
        f"Judged on {len(rows)} simulated insertions, seeds {min(seeds)} to {max(seeds)}, that it was not chosen by:",
        *(f"{wish}: {found}{'' if holds else ' - NOT fulfilled'}" for wish, found, holds in evidence),
    ]
    return "".join(f"# {line}\n" for line in lines) + toml(best.sets)


def _data(
    best: "Candidate",
    tried: "Sequence[Candidate]",
    evidence: "Sequence[tuple[str, str, bool]]",
    is_good: bool,
    recipe: Path,
) -> dict[str, object]:
    from dataclasses import asdict

    return {
        "fulfilled": is_good,
        "judged": [{"wish": wish, "found": found, "holds": holds} for wish, found, holds in evidence],
        "best": asdict(best),
        "tried": [asdict(each) for each in tried],
        "file": str(recipe),
    }


def _table(evidence: "Sequence[tuple[str, str, bool]]", best: "Candidate") -> "Table":
    from rich.table import Table

    table = Table(title="The best setting, judged on seeds that it was not chosen by", title_justify="left")
    for name in ("wish", "reached", "holds"):
        table.add_column(name)
    for wish, found, holds in evidence:
        table.add_row(wish, found, "yes" if holds else "no")
    table.caption = f"sections: 0 careful, 1 balanced, 2 fast. {_figures(best)}"
    return table


def _figures(best: "Candidate") -> str:
    return ", ".join(f"{name} = {value:.4g}" for name, value in best.figures.items())
