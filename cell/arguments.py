"""The command line: commands, their options, and what is allowed in each."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from drivers.errors import ConfigError


class Parser(argparse.ArgumentParser):
    """Raises what is wrong, so that it is told like any other wrong use."""

    def error(self, message: str) -> NoReturn:
        """Raise.

        Raises:
            ConfigError: Always.
        """
        raise ConfigError(message)


def parser(formats: Sequence[str], studies: Sequence[str]) -> Parser:
    """Return the parser of all commands; `formats` are those of the register map, `studies` the names of the studies."""
    whole = Parser(
        prog="cell", description="Inserts a loosely held peg by touch. Without --config: the simulated cell."
    )
    commands = whole.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def add(name: str, text: str, *shared: str) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=text, description=text)
        command.add_argument("-v", "--verbose", action="store_true", help="log everything")
        command.add_argument("--json", action="store_true", help="print the result as JSON")
        if "config" in shared:
            command.add_argument("--config", type=Path, metavar="F", help="TOML file of the cell")
            command.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="replace one key")
        if "journal" in shared:
            command.add_argument("--journal", type=Path, metavar="DIR", help="folder of the records of runs")
        return command

    add("check", "open every device of a config, read each once, say what is wrong", "config")
    command = add("demo", "the main job: a PLC peer triggers insertions over Modbus TCP", "config", "journal")
    command.add_argument("--trials", type=_positive, default=5, metavar="N")
    command.add_argument("--out", type=Path, default=Path("out/demo"), metavar="DIR", help="where the pictures go")
    add("serve", "obey the PLC until SIGINT or SIGTERM", "config", "journal")
    command = add("run", "one skill or program, by hand", "config", "journal")
    command.add_argument("name", metavar="NAME")
    command.add_argument("--connect", type=_address, metavar="HOST:PORT", help="on a cell that is served there")
    command.add_argument("--recipe", type=_natural, default=0, metavar="N")
    command.add_argument("--serial", default="", metavar="TEXT", help="of the part, for the record")
    command = add("watch", "live state of a cell that is served")
    command.add_argument("--connect", type=_address, required=True, metavar="HOST:PORT")
    command.add_argument("--once", action="store_true", help="the state now, and no more")
    command = add("trials", "many insertions on fresh simulated cells", "config")
    command.add_argument("--trials", type=_positive, default=40, metavar="N")
    command.add_argument("--seed", type=_natural, default=1, metavar="S", help="of the first trial")
    where = command.add_mutually_exclusive_group()
    where.add_argument("--workers", type=_positive, metavar="N", help="processes; one for each core")
    where.add_argument("--scheduler", type=_scheduler, metavar="tcp://HOST:PORT", help="of a Dask cluster")
    command.add_argument("--out", type=Path, required=True, metavar="DIR")
    command = add("skin", "both fingers live, or as they were recorded", "config")
    command.add_argument("--seconds", type=float, metavar="S", help="how long; until stopped, in a pipe 1")
    command.add_argument("--out", type=Path, metavar="PNG", help="picture of the last frame")
    command.add_argument("--record", type=Path, metavar="FILE", help="write the traffic of the wire")
    command.add_argument("--replay", type=Path, metavar="FILE", help="recorded traffic, or a text recording")
    command = add("calibrate", "measure a device and write a dated file", "config")
    command.add_argument("device", choices=["skin"], metavar="DEVICE", help="skin")
    command.add_argument("--out", type=Path, metavar="DIR", help="instead of calibration/ beside the config file")
    command = add("study", "one study", "config")
    command.add_argument("name", choices=studies, metavar="NAME", help=", ".join(studies))
    command.add_argument("--out", type=Path, default=Path("out/study"), metavar="DIR", help="where its files go")
    command.add_argument("--quick", action="store_true", help="less of everything")
    command.add_argument("--seed", type=_natural, default=1, metavar="S", help="of the first trial")
    command.add_argument(
        "--trials", type=_positive, metavar="N", help="wire: through each, 20; frontier: a variant, 40; events: 1000"
    )
    command.add_argument("--workers", type=_positive, metavar="N", help="processes; one for each core")
    command.add_argument("--profile", action="store_true", help="speed: where the time of a trial goes")
    command = add("runs", "the newest runs on record", "journal")
    command.add_argument("--last", type=_positive, default=20, metavar="N")
    command = add("show", "one run on record, with its plots", "journal")
    command.add_argument("number", type=_positive, metavar="RUN")
    command.add_argument("--export", type=Path, metavar="DIR", help="raw samples as CSV")
    add("faults", "every fault code: meaning, cause, what to do")
    command = add("map", "the register map")
    command.add_argument("--format", choices=formats, default="md")
    return whole


def _positive(text: str) -> int:
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r}: a whole number >= 1 allowed")
    return int(text)


def _natural(text: str) -> int:
    if not text.isdigit():
        raise argparse.ArgumentTypeError(f"{text!r}: a whole number >= 0 allowed")
    return int(text)


def _address(text: str) -> tuple[str, int]:
    host, colon, port = text.rpartition(":")
    if not colon or not host or not port.isdigit() or not 0 < int(port) < 65536:
        raise argparse.ArgumentTypeError(f"{text!r}: HOST:PORT allowed, as in 127.0.0.1:5020")
    return host.strip("[]"), int(port)


def _scheduler(text: str) -> str:
    protocol, colon, address = text.partition("://")
    try:
        _address(address)
    except argparse.ArgumentTypeError:
        colon = ""
    if not colon or protocol not in ("tcp", "tls"):
        raise argparse.ArgumentTypeError(
            f"{text!r}: tcp://HOST:PORT or tls://HOST:PORT allowed, as in tcp://127.0.0.1:8786"
        )
    return text
