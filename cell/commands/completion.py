"""`cell completion`: print a shell script that completes commands, options and names."""

import argparse

from cell.commands.terminal import GOOD, say

SHELLS = ("bash", "zsh", "tcsh")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the shell."""
    parser.add_argument("shell", choices=SHELLS, metavar="SHELL", help=f"{', '.join(SHELLS)}")


def run(args: argparse.Namespace) -> int:
    """Print the script."""
    import shtab

    say(shtab.complete(args.parser, shell=args.shell))
    return GOOD
