"""`cell faults`: meaning, cause and remedy of every fault code, or of one."""

import argparse
from dataclasses import asdict

from cell.commands.terminal import filled, show
from cell.config.nearest import did_you_mean
from drivers.errors import FAULTS, ConfigError, FaultCode


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the fault."""
    parser.add_argument("code", nargs="?", metavar="CODE", help="number or name of one fault, as in 1002")


def run(args: argparse.Namespace) -> int:
    """Show the faults."""
    codes = FAULTS if args.code is None else [_found(args.code)]
    faults = {code: FAULTS[code] for code in codes}
    head = ("code", "name", "meaning", "cause", "what to do before the reset")
    rows = [(str(code.value), code.name, text.meaning, text.cause, text.remedy) for code, text in faults.items()]
    data = [{"code": code.value, "name": code.name, **asdict(text)} for code, text in faults.items()]
    return show(args, filled(head, rows, show_lines=True), data)


def _found(text: str) -> FaultCode:
    """Return the fault with a number or a name.

    Raises:
        ConfigError: The fault does not exist.
    """
    known = {str(code.value): code for code in FAULTS} | {code.name: code for code in FAULTS}
    if text.upper() not in known:
        numbers = ", ".join(str(code.value) for code in FAULTS)
        raise ConfigError(f"fault {text}: no such code; {numbers} allowed{did_you_mean(text.upper(), known)}")
    return known[text.upper()]
