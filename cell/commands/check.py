"""`cell check`: open and read every device of a config once; with --plc, commission cell and PLC together."""

import argparse
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from cell.commands.arguments import add_config, add_journal, load_config, open_journal
from cell.commands.terminal import FAULT, GOOD, NOT_GOOD, complain, say, show
from drivers.errors import ConfigError

if TYPE_CHECKING:
    from cell.config.load import LoadedConfig
    from plc_bridge.config import PlcConfig

SUMMARY = "open every device of a config, read each once, say what is wrong; with --plc, commission cell and PLC"
PATIENCE = 300.0
"""Longest time for one step of the commissioning, s."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add --config, --set and the options of commissioning."""
    add_config(parser)
    add_journal(parser)
    parser.add_argument(
        "--plc", metavar="HOST", help='address of the PLC that will connect, "node 1" on CAN, "rtu:ttyUSB0" on a line'
    )
    parser.add_argument(
        "--name", default="", metavar="NAME", help="name of the person who commissions, for the record of --plc"
    )
    parser.add_argument("--out", type=Path, metavar="FILE", help="file for the record of --plc, JSON")


def run(args: argparse.Namespace) -> int:
    """Open each device and the bridge's sockets, or run the commissioning; return GOOD if all checks pass."""
    if args.plc is None and (args.name or args.out is not None):
        raise ConfigError("--name, --out: only with --plc HOST")
    loaded = load_config(args)
    return _check(args, loaded) if args.plc is None else _commission(args, loaded)


def _check(args: argparse.Namespace, loaded: "LoadedConfig") -> int:
    from rich.table import Table

    from cell.config.parameters import PARAMETERS
    from cell.devices.assembly import assemble, check
    from cell.devices.checks import OK
    from cell.run.line import PROGRAMS
    from drivers.errors import CellError
    from plc_bridge.bridge import Bridge

    found = check(assemble(loaded.cell))
    bridge = Bridge(loaded.cell.plc, PROGRAMS, PARAMETERS)
    try:
        bridge.start()
        found.append(("plc", OK))
    except CellError as error:
        found.append(("plc", f"fault {error.code.value}: {error}"))
    finally:
        bridge.close()
    found += _network(loaded.cell.plc)
    table = Table("device", "found")
    for name, text in found:
        table.add_row(name, text)
    show(args, table, [{"device": name, "found": text} for name, text in found])
    return GOOD if all(text.startswith(OK) for _, text in found) else FAULT


def _network(plc: "PlcConfig") -> list[tuple[str, str]]:
    """Return the open ports and the remaining validity of each key."""
    from cell.devices.checks import OK
    from cell.page.exposure import exposures, key_days, key_verdict
    from drivers.errors import DeviceNotOpenedError

    found = [("network", f"{OK}, but {line}") for line in exposures(plc)]
    with suppress(DeviceNotOpenedError):  # already in the report of the bridge
        found += [(name, key_verdict(days)) for name, days in key_days(plc.tls).items()]
    return found


def _commission(args: argparse.Namespace, loaded: "LoadedConfig") -> int:
    """Serve the cell to the PLC and watch its commands until every step has passed or one has failed."""
    import json

    from cell.calibrate.commissioning import Walk, WatchedLine, record
    from cell.commands.warm_up import warm_up
    from cell.config.parameters import PARAMETERS
    from cell.devices.assembly import assemble, opened
    from cell.records.versions import PROGRAM, installed
    from cell.run.line import PROGRAMS
    from cell.run.supervisor import Supervisor
    from plc_bridge.bridge import Bridge

    warm_up(loaded)
    bridge = Bridge(loaded.cell.plc, PROGRAMS, PARAMETERS)
    walk = Walk(args.plc, loaded.cell.plc.life_timeout, PATIENCE, complain if args.json else say)
    line = WatchedLine(bridge, walk, args.stop)
    with open_journal(args, loaded.cell.journal) as journal, opened(assemble(loaded.cell)) as cell:
        supervisor = Supervisor(cell, loaded, line, journal, args.stop)
        supervisor.scan()
        bridge.start()
        try:
            line.begin()
            supervisor.serve()
        finally:
            bridge.close()
    found = record(walk, args.name, datetime.now().astimezone().isoformat(timespec="seconds"), installed(PROGRAM))
    text = json.dumps(found, indent=2)
    if args.out is not None:
        args.out.write_text(text + "\n", encoding="utf-8")
    show(args, _sheet(found), found)
    return GOOD if found["passed"] else NOT_GOOD


def _sheet(found: dict[str, object]) -> str:
    """Return the printable record, with a line for the signature."""
    steps = found["steps"]
    assert isinstance(steps, list)
    head = [f"{key}: {found[key]}" for key in ("what", "date", "technician", "plc", "version", "map")]
    rows = [f"  {'passed' if each['passed'] else 'FAILED'}  {each['step']}: {each['measured']}" for each in steps]
    verdict = "PASSED" if found["passed"] else "NOT PASSED"
    return "\n".join([*head, *rows, verdict, "signed: ______________________"])
