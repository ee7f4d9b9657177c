"""`cell tune`: search for a recipe that fulfils a wish for time, force and success, and its evidence."""

import argparse
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from cell.commands.arguments import add_config, folder_path, out_folder, positive
from cell.commands.terminal import GOOD, NOT_GOOD, complain, show, written
from cell.lab.arguments import SEED, WORKERS, Options, add_options, advancing, load_simulated
from drivers.errors import ConfigError

if TYPE_CHECKING:
    from cell.lab.tune.measure import Space


def _count(default: int, meaning: str) -> dict[str, Any]:
    return {"type": positive, "default": default, "metavar": "N", "help": f"{meaning}; default {default}"}


OPTIONS: Options = {
    "--want": {
        "required": True,
        "metavar": "WISH",
        "help": 'as in "p95<=8 s, force<=20 N, success>=98 %%"; mean<= as well',
    },
    "--method": {"metavar": "NAME", "help": "method of `cell study frontier` to tune; default the cell's own"},
    "--scene": {"metavar": "NAME", "help": "scene of --method; default its first"},
    "--candidates": _count(18, "settings to try"),
    "--trials": _count(16, "insertions by each setting at most"),
    "--judge": _count(60, "insertions by the best setting, on other seeds"),
    **SEED,
    **WORKERS,
    "--out": {"type": folder_path, "required": True, "metavar": "DIR"},
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the wish, the effort, and the output file of the recipe."""
    add_config(parser)
    add_options(parser, OPTIONS)


def run(args: argparse.Namespace) -> int:
    """Search settings, judge the best one, write the recipe; if the wish is not fulfilled, print the result and return NOT_GOOD."""
    away = 1_000_000  # Distance between the seeds for the choice of settings and the seeds for judging the best one.
    from pydantic_core import to_jsonable_python

    from cell.lab.tables import table
    from cell.lab.trials import run_trials
    from cell.lab.tune import measure
    from cell.lab.tune.wish import wishes_of
    from cell.records.provenance import versions

    wishes = wishes_of(args.want)
    load_simulated(args)
    space = _space(args)
    folder, seeds = out_folder(args.out), range(args.seed, args.seed + args.trials)
    with advancing("settings", args.candidates * len(seeds)) as done:
        tried = measure.tune(space, wishes, seeds, args.candidates, args.workers, folder, done)
    best, fresh = tried[0], range(args.seed + away, args.seed + away + args.judge)
    with advancing("judging", args.judge) as done:
        config, program = space.config(best.sets), space.program(best.figures)
        rows = run_trials(config, fresh, args.workers, folder / "judged", lambda row: done(1), program=program)
    evidence = [{"wish": wish.text, "found": wish.found(rows), "holds": wish.holds(rows)} for wish in wishes]
    is_good, recipe = all(each["holds"] for each in evidence), folder / "recipe.toml"
    figures = ", ".join(f"{name} = {value:.4g}" for name, value in best.figures.items())
    lines = [
        f"Wished: {args.want}. Found by `cell tune` on {datetime.now(UTC):%Y-%m-%d}, code {versions()['code']},",
        f"among {len(tried)} settings. A section is between the preset `careful`, 0, and the cell's own figures, 1: {figures}.",
        f"Judged on {len(rows)} simulated insertions, seeds {fresh[0]} to {fresh[-1]}, which were not used to choose it:",
        *(f"{each['wish']}: {each['found']}{'' if each['holds'] else ' - NOT fulfilled'}" for each in evidence),
    ]
    recipe.write_text("".join(f"# {line}\n" for line in lines) + measure.toml(best.sets), encoding="utf-8")
    shown = table(
        "The best setting, judged on seeds that were not used to choose it",
        {"wish": lambda each: each["wish"]},
        {"reached": lambda each: each["found"], "holds": lambda each: "yes" if each["holds"] else "no"},
        evidence,
        f"sections: 0 careful, 1 the cell's own. {figures}",
    )
    facts = {"fulfilled": is_good, "judged": evidence, "best": best, "tried": tried, "file": str(recipe)}
    show(args, shown, to_jsonable_python(facts, inf_nan_mode="null"))
    written(args, [recipe])
    if is_good:
        return GOOD
    nearest = "; ".join(f"{each['wish']}: {each['found']}" for each in evidence)
    return complain(f"--want {args.want}: not fulfilled by any of {len(tried)} settings; nearest: {nearest}", NOT_GOOD)


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
