"""`cell learned`: show or delete the place of the hole that the cell has learnt for each recipe."""

import argparse
from pathlib import Path

from rich.table import Table

from cell.commands.arguments import add_config, add_journal, load_config, natural, open_journal, require_recipe
from cell.commands.terminal import show
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
    table, data = _table(args.recipe, loaded, folder)
    return show(args, table if data else "nothing was learnt", data)


def _table(recipe: int | None, loaded: LoadedConfig, folder: Path) -> tuple[Table, list[dict[str, object]]]:
    """Return the learnt place of one recipe, or of every recipe if it is None, as a table and as data in SI units."""
    table = Table("recipe", "x, y (mm)", "deviation (mm)", "parts", "age (h)", "use")
    data: list[dict[str, object]] = []
    now = wall_clock.now()
    for name, place in sorted(read_learned(folder).places.items(), key=lambda item: int(item[0])):
        number = int(name)
        if recipe is not None and number != recipe:
            continue
        config = loaded.recipes.get(number)
        why = (
            "no such recipe" if config is None else unusable(place, config.job(), config.learning, now) or place.doubt()
        )
        prior = place.estimate().prior(loaded.cell.learning)
        deviation = None if prior is None else prior.deviation
        age = (now - place.updated).total_seconds()
        use = why or "in use"
        data.append(
            {
                "recipe": number,
                "mean": place.mean,
                "deviation": deviation,
                "parts": place.parts,
                "age": age,
                "use": use,
            }
        )
        table.add_row(
            str(number), _millimetres(place.mean), _millimetres(deviation), str(place.parts), f"{age / 3600:.1f}", use
        )
    return table, data


def _millimetres(pair: tuple[float, float] | None) -> str:
    return "" if pair is None else ", ".join(f"{value * 1e3:.2f}" for value in pair)
