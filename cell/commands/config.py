"""`cell config`: the meaning of a key, the values in force with their origins, and the differences of two configs."""

import argparse
import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from rich.console import Group, RenderableType

from cell.commands.arguments import Parser, add_config, add_shared, load_config, natural, require_recipe
from cell.commands.terminal import GOOD, filled, say, show
from cell.config.files import has_file, presets
from cell.config.keys import Key, Setting, find, in_force, keys, planned, toml
from cell.config.load import LoadedConfig, load
from cell.config.nearest import did_you_mean
from cell.config.text import as_toml, commented, file_schema
from drivers.errors import ConfigError
from drivers.figures_file import read_toml, write_whole


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the subcommands."""
    asked = parser.add_subparsers(dest="asked", required=True, metavar="WHAT", parser_class=Parser)

    def add(name: str, text: str) -> argparse.ArgumentParser:
        own = asked.add_parser(name, help=text, description=text)
        add_shared(own)
        return own

    own = add("explain", "a key: meaning, unit, range, default, source, who reads it, and what is in force")
    add_config(own)
    own.add_argument("key", metavar="KEY", help="a key, as in search.speed, or a section, as in search")
    own = add("show", "every key in force, as a config file, with the origin of each")
    add_config(own)
    own.add_argument("section", nargs="?", default="", metavar="SECTION", help="only this section")
    own.add_argument("--in-force", action="store_true", help="figures of an insertion and reasons of their changes")
    own.add_argument(
        "--attempt", type=natural, default=0, metavar="N", help="after N failed tries at one place; with --in-force"
    )
    own.add_argument("--recipe", type=natural, default=0, metavar="N", help="number of the recipe whose part is shown")
    own = add("diff", "the keys in which two configs differ")
    add_config(own)
    own.add_argument("first", metavar="A", help="file of a cell, or name of a preset")
    own.add_argument("second", metavar="B", help="file of another cell, or name of another preset")
    add("schema", "the JSON schema of a cell's file, for editors that complete and check TOML")
    own = add("comment", "write the meaning of each key into a config file")
    own.add_argument("file", type=Path, metavar="FILE")


def run(args: argparse.Namespace) -> int:
    """Run the subcommand."""
    return {"explain": _explain, "show": _show, "diff": _diff, "schema": _schema, "comment": _comment}[args.asked](args)


def _explain(args: argparse.Namespace) -> int:
    loaded = load_config(args)
    settings = {setting.key: setting for setting in in_force(loaded)}
    found = find(args.key)
    if not found:
        raise ConfigError(f"config explain {args.key}: no such key{_meant(args.key)}")
    told = [_told(key, settings.get(key)) for key in found]
    is_one = found[0].name == args.key
    return show(args, Group(*map(_card, told)) if is_one else _list(found, settings), told)


def _meant(word: str) -> str:
    """Return a hint with likely keys: those with the same ending, or with a similar name."""
    names = list(dict.fromkeys(key.name for key in keys()))
    alike = [name for name in names if name.endswith(f".{word}")]
    return f"; did you mean {', '.join(alike)}?" if alike else did_you_mean(word, names)


def _told(key: Key, setting: Setting | None) -> dict[str, Any]:
    return {
        "key": key.name,
        "kind": key.kind,
        "meaning": key.meaning,
        "unit": key.unit,
        "allowed": key.allowed,
        "default": key.default,
        "in_force": None if setting is None else toml(setting.value),
        "from": "" if setting is None else setting.origin,
        "source": list(key.sources),
        "read_by": key.reader,
        "set_by": list(key.setters),
    }


def _card(told: dict[str, Any]) -> RenderableType:
    is_used = told["in_force"] is not None
    rows = (
        ("meaning", told["meaning"]),
        ("unit", told["unit"] or "none"),
        ("allowed", told["allowed"]),
        ("default", "none: the key is required" if told["default"] is None else told["default"]),
        ("in force", f"{told['in_force']}, from {_short(told['from'])}" if is_used else "not in this cell"),
        ("source", "; ".join(told["source"]) or "chosen"),
        ("read by", told["read_by"]),
        ("set by", ", ".join(told["set_by"])),
    )
    return filled((), rows, show_header=False, title=f"{told['key']}{' where ' + told['kind'] if told['kind'] else ''}")


def _list(found: list[Key], settings: dict[Key, Setting]) -> RenderableType:
    # Keys of other kinds of a device are left out; if the cell lacks a section, all of it is shown.
    shown = [key for key in found if key in settings] or found
    values = {key: toml(setting.value) for key, setting in settings.items()}
    rows = [(key.name, values.get(key, "not in this cell"), key.summary) for key in shown]
    return filled(("key", "in force", "meaning"), rows)


def _show(args: argparse.Namespace) -> int:
    loaded = load_config(args)
    require_recipe(args.recipe, loaded)
    if args.section and not find(args.section):
        raise ConfigError(f"config show {args.section}: no such section or key{_meant(args.section)}")
    if args.in_force:
        return _show_plan(args, loaded)
    settings = [each for each in in_force(loaded, args.recipe) if _is_in(each.key.name, args.section)]
    data = [
        {"key": each.key.name, "value": toml(each.value), "unit": each.key.unit, "from": each.origin}
        for each in settings
    ]
    return show(args, as_toml(replace(each, origin=_short(each.origin)) for each in settings), data)


def _show_plan(args: argparse.Namespace, loaded: LoadedConfig) -> int:
    found = [each for each in planned(loaded, args.recipe, args.attempt) if _is_in(each.name, args.section)]
    lines = []
    for each in found:
        why = f"changed by {', '.join(each.reasons)}" if each.reasons else ""
        notes = (each.unit, _short(each.origin), why, "CAPPED" if each.is_capped else "")
        lines.append(f"{each.name} = {toml(each.value)}  # {', '.join(filter(None, notes))}")
    return show(args, "\n".join(lines), [asdict(each) for each in found])


def _is_in(name: str, section: str) -> bool:
    """Return True if a key belongs to a section or is the section itself; every key belongs to the empty one."""
    return not section or f"{name}.".startswith(f"{section}.")


def _short(origin: str) -> str:
    """Return the path of a file below the working folder relative to this folder; any other origin is unchanged."""
    path = Path(origin)
    return str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else origin


def _diff(args: argparse.Namespace) -> int:
    values: list[dict[str, str]] = []
    units: dict[str, str] = {}
    for word in (args.first, args.second):
        settings = in_force(_named(args, word))
        values.append({each.key.name: toml(each.value) for each in settings})
        units |= {each.key.name: each.key.unit for each in settings}
    told = [
        {"key": name, "first": values[0].get(name), "second": values[1].get(name), "unit": unit}
        for name, unit in units.items()
        if values[0].get(name) != values[1].get(name)
    ]
    rows = [(row["key"], row["first"] or "-", row["second"] or "-", row["unit"]) for row in told]
    table = filled(("key", args.first, args.second, "unit"), rows)
    return show(args, table if told else "no key differs", told)


def _named(args: argparse.Namespace, word: str) -> LoadedConfig:
    """Return the config of a cell's file, or the one of --config with a preset.

    Raises:
        ConfigError: Neither a file nor a preset has this name.
    """
    if word in presets(args.config):
        return load(args.config, preset=word, sets=args.set)
    if not has_file(Path(word)):
        known = presets(args.config)
        why = f"no such file and no such preset; a file, or {', '.join(known)} allowed"
        raise ConfigError(f"config diff {word}: {why}{did_you_mean(word, known)}")
    return load(Path(word), sets=args.set)


def _schema(args: argparse.Namespace) -> int:
    say(json.dumps(file_schema(), indent=2, ensure_ascii=False))
    return GOOD


def _comment(args: argparse.Namespace) -> int:
    read_toml(args.file)
    before = args.file.read_text(encoding="utf-8")
    after = commented(before)
    write_whole(args.file, after, "config")
    lines = sum(one != other for one, other in zip(before.splitlines(), after.splitlines(), strict=True))
    return show(args, f"{args.file}: {lines} lines changed", {"file": str(args.file), "lines": lines})
