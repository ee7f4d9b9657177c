"""`cell learned`: show or delete the place of the hole that the cell has learnt for each recipe."""

import argparse
from pathlib import Path

from rich.table import Table

from cell.commands.arguments import add_config, add_journal, load_config, natural, open_journal, require_recipe
from cell.commands.terminal import filled, show
from cell.config.load import LoadedConfig
from cell.records import wall_clock
from cell.run.learning import forget, read_learned, unusable

ACTIONS = ("show", "forget")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the action, the recipe, and the folder of the records."""
    add_config(parser)
    add_journal(parser)
    text = f"{' or '.join(ACTIONS)}; default show"
    parser.add_argument("action", choices=ACTIONS, metavar="ACTION", nargs="?", default="show", help=text)
    parser.add_argument("--recipe", type=natural, metavar="N", help="number of the recipe; default all")


def run(args: argparse.Namespace) -> int:
    """Show the learnt places, one line per recipe, or delete them."""
    loaded = load_config(args)
    folder = open_journal(args, loaded.cell.journal).folder
    if args.recipe is not None:
        require_recipe(args.recipe, loaded)
    if args.action == "forget":
        forgotten = forget(folder, args.recipe)
        told = f"forgotten: recipe {', '.join(map(str, forgotten))}" if forgotten else "nothing was learnt"
        return show(args, told, {"forgotten": forgotten})
    rows = _rows(args.recipe, loaded, folder)
    return show(args, _table(rows) if rows else "nothing was learnt", rows)


def _rows(recipe: int | None, loaded: LoadedConfig, folder: Path) -> list[dict[str, object]]:
    """Return the learnt place of one recipe, or of every recipe if it is None, in SI units."""
    rows: list[dict[str, object]] = []
    for number, place in sorted(read_learned(folder).places.items(), key=lambda item: int(item[0])):
        if recipe is not None and int(number) != recipe:
            continue
        config = loaded.recipes.get(int(number))
        now = wall_clock.now()
        why = (
            "no such recipe" if config is None else unusable(place, config.job(), config.learning, now) or place.doubt()
        )
        prior = place.estimate().prior(loaded.cell.learning)
        rows.append(
            {
                "recipe": int(number),
                "mean": place.mean,
                "deviation": prior.deviation if prior is not None else None,
                "parts": place.parts,
                "age": (now - place.updated).total_seconds(),
                "use": why or "in use",
            }
        )
    return rows


def _table(rows: list[dict[str, object]]) -> Table:
    shown = [
        (
            str(row["recipe"]),
            _millimetres(row["mean"]),
            _millimetres(row["deviation"]),
            str(row["parts"]),
            f"{float(str(row['age'])) / 3600:.1f}",
            str(row["use"]),
        )
        for row in rows
    ]
    return filled(("recipe", "x, y (mm)", "deviation (mm)", "parts", "age (h)", "use"), shown)


def _millimetres(pair: object) -> str:
    return ", ".join(f"{value * 1e3:.2f}" for value in pair) if isinstance(pair, tuple) else ""
