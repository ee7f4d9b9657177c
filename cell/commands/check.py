"""`cell check`: every device of a config, opened and read once."""

import argparse

from cell.arguments import add_config, load_config
from cell.terminal import FAULT, GOOD, show

SUMMARY = "open every device of a config, read each once, say what is wrong"
STOPS_ITSELF = False


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add --config and --set."""
    add_config(parser)


def run(args: argparse.Namespace) -> int:
    """Open each device and the bridge's sockets; return GOOD when all of them answer."""
    from rich.table import Table

    from cell.assembly import assemble, check
    from cell.line import PARAMETERS, PROGRAMS
    from drivers.errors import CellError
    from plc_bridge.bridge import Bridge

    loaded = load_config(args)
    found = check(assemble(loaded.cell))
    bridge = Bridge(loaded.cell.plc, PROGRAMS, PARAMETERS)
    try:
        bridge.start()
        found.append(("plc", "ok"))
    except CellError as error:
        found.append(("plc", f"fault {error.code.value}: {error}"))
    finally:
        bridge.close()
    table = Table("device", "found")
    for name, text in found:
        table.add_row(name, text)
    show(args, table, [{"device": name, "found": text} for name, text in found])
    return GOOD if all(text == "ok" for _, text in found) else FAULT
