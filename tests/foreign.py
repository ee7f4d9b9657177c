"""PLC-side programs that are not ours, built from what `cell map` prints and from nothing else of the cell.

    python -m tests.foreign [--pegs 100] [--client NAME]... [--set KEY=VALUE]...

serves the simulated cell of docs/examples/line for each of them in turn, lets it insert so many pegs, and compares what it
read with the records. It ends with status 0 if every peg was inserted and reported as inserted.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from cell.records.journal import Journal
from skills.contract import Outcome
from tests.certificates import Authority, utf8
from tests.hubs import SocketcandHub
from tests.serving import process

ROOT = Path(__file__).parents[1]
CLIENTS, EXAMPLE = ROOT / "tests" / "clients", ROOT / "docs" / "examples" / "line"
NODE_CLIENT = CLIENTS / "node"
"""Where `npm ci` puts node-opcua."""
MATIEC = ROOT / "build" / "matiec"
"""Where `.ci/run` builds it."""
SETTINGS = ('sim.pace="max"', "reality.scale=0", "plc.life_timeout=20", "plc.lease_timeout=20", "plc.modbus.port=0")
"""Settings for a cell that is judged by the answers to its PLC: the ideal one, as fast as it goes, patient on a busy computer."""
LONGEST = 120.0
"""Longest time for one peg, s."""
NODE = 16
"""Node-ID of a cell whose config has no other."""
INSERT_PEG = re.compile(r"^#define CELL_CODE_INSERT_PEG (\d+)$", re.MULTILINE)


def call(*command: object, folder: Path | None = None, longest: float = 240.0, **environment: str) -> str:
    """Return the output of a program; if the program failed, fail with this output."""
    done = subprocess.run(
        [str(word) for word in command],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=longest,
        check=False,
        cwd=folder,
        env={**os.environ, **environment},
    )
    assert done.returncode == 0, done.stdout
    return done.stdout.strip()


@cache
def printed(kind: str) -> str:
    """Return what `cell map` prints in one of its formats, each of which takes a process."""
    return call(sys.executable, "-m", "cell", "map", "--format", kind) + "\n"


def exported(kind: str, folder: Path) -> Path:
    """Return a file with what it prints in one of its formats."""
    path = folder / f"cell_map.{kind}"
    path.write_text(printed(kind), encoding="utf-8")
    return path


# What there is on this computer.


def has_libmodbus() -> bool:
    """Return True if libmodbus and a C compiler are installed."""
    tools = shutil.which("cc") and shutil.which("pkg-config")
    return bool(tools) and subprocess.run(["pkg-config", "--exists", "libmodbus"], check=False).returncode == 0


def has_go() -> bool:
    """Return True if Go and the packages of its client are on this computer."""
    offline = {**os.environ, "GOPROXY": "off"}
    quiet = subprocess.DEVNULL
    command = ["go", "mod", "download"]
    return bool(shutil.which("go")) and not subprocess.call(
        command, cwd=CLIENTS / "go", env=offline, stdout=quiet, stderr=quiet
    )


def has_node() -> bool:
    """Return True if Node is installed, with its OPC UA client in tests/clients/node."""
    return bool(shutil.which("node")) and (NODE_CLIENT / "node_modules" / "node-opcua-client").is_dir()


def has_matiec() -> bool:
    """Return True if MATIEC is built and the libraries that its program links are installed."""
    return (MATIEC / "iec2c").is_file() and has_libmodbus()


# How each is built.


def libmodbus_client(folder: Path) -> Path:
    """Compile the client in C against the exported header."""
    exported("h", folder)
    program = folder / "libmodbus_client"
    flags = call("pkg-config", "--cflags", "--libs", "libmodbus").split()
    strict = ("-std=c11", "-Wall", "-Wextra", "-Werror")
    call("cc", *strict, "-I", folder, "-o", program, CLIENTS / "libmodbus_client.c", *flags)
    return program


def go_client(folder: Path) -> Path:
    """Compile the client in Go, which reads the exported header when it runs."""
    exported("h", folder)
    program = folder / "go_client"
    # Its speed is no matter: without optimisation, debugging tables and C, all its packages compile in half the time.
    quickly = ("-gcflags=all=-N -l", "-ldflags=-s -w")
    call("go", "build", *quickly, "-o", program, ".", folder=CLIENTS / "go", CGO_ENABLED="0")
    return program


def soft_plc(folder: Path) -> Path:
    """Compile the line of the example with MATIEC, as its own script says."""
    cell = folder / "bin" / "cell"
    cell.parent.mkdir()
    cell.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m cell "$@"\n', encoding="utf-8")
    cell.chmod(0o755)
    path = os.pathsep.join([str(cell.parent), os.environ["PATH"]])
    call(EXAMPLE / "build.sh", MATIEC, folder, folder=ROOT, PATH=path)
    return folder / "plc"


# How each inserts pegs: the programs print `triggered N done N`, the line `fed N good N bad 0 recovered 0`.

Place = tuple[str, int]


def by_libmodbus(folder: Path, place: Place, hub: Place, pegs: int) -> str:
    return call(libmodbus_client(folder), "tcp", *place, pegs, longest=LONGEST * pegs)


def by_go(folder: Path, place: Place, hub: Place, pegs: int) -> str:
    program = go_client(folder)
    return call(program, f"tcp://{place[0]}:{place[1]}", pegs, folder / "cell_map.h", longest=LONGEST * pegs)


def by_canopen(folder: Path, place: Place, hub: Place, pegs: int) -> str:
    (code,) = INSERT_PEG.findall(exported("h", folder).read_text(encoding="utf-8"))
    channel = f"{hub[0]}:{hub[1]}/can0"
    words = ["socketcand", channel, exported("eds", folder), NODE, code, pegs]
    return call(sys.executable, CLIENTS / "canopen_client.py", *words, longest=LONGEST * pegs)


def by_matiec(folder: Path, place: Place, hub: Place, pegs: int) -> str:
    return call(soft_plc(folder), *place, pegs, round(LONGEST * pegs), longest=LONGEST * pegs)


def by_node(folder: Path, place: Place, hub: Place, pegs: int) -> str:
    """Insert pegs by node-opcua over OPC UA; it loses its session in the middle one's run."""
    keys = folder / "plc.pem", folder / "plc.key"
    words = [f"opc.tcp://{place[0]}:{place[1]}/", pegs, pegs // 2, *keys, folder / "store"]
    said = call("node", NODE_CLIENT / "client.js", *words, longest=LONGEST * pegs)
    return next(line for line in said.splitlines() if line.startswith("triggered"))  # between warnings of the library


WAYS: dict[str, tuple[Callable[[], bool], Callable[[Path, Place, Place, int], str]]] = {
    "matiec": (has_matiec, by_matiec),
    "libmodbus": (has_libmodbus, by_libmodbus),
    "go": (has_go, by_go),
    "canopen": (lambda: True, by_canopen),
    "node": (has_node, by_node),
}


def secured(folder: Path) -> list[str]:
    """Return the settings of a cell over OPC UA, and write its keys and those of `by_node` into the folder."""
    authority = Authority(folder)
    cell = authority.cell("urn:test:cell")
    authority.sign("plc", utf8("Operator"), uri="urn:test:plc")
    roles = 'plc.tls.roles={"Operator"=["read", "command"]}'
    files = [f'plc.tls.{name}="{getattr(cell, name)}"' for name in ("certificate", "key", "authority")]
    return ['plc.tls.host="127.0.0.1"', "plc.tls.port=0", roles, *files]


@contextmanager
def served(folder: Path, sets: Sequence[str], is_opcua: bool = False) -> Iterator[Place]:
    """Yield where a cell of its own process listens for Modbus or for OPC UA, with its records in `folder`."""
    options = ["--config", str(EXAMPLE / "cell.toml"), *(["--opcua", "127.0.0.1:0"] if is_opcua else [])]
    with process(folder, sets, *options, lines=1 + is_opcua) as (running, places):
        try:
            yield places[-1]
        finally:
            running.terminate()
            running.wait()


def insert(name: str, pegs: int, sets: Sequence[str]) -> bool:
    """Let one of them insert pegs, print the outcome, and return whether it is correct."""
    has, run = WAYS[name]
    if not has():
        sys.stdout.write(f"{name}: not on this computer\n")
        return False
    with SocketcandHub() as hub, tempfile.TemporaryDirectory() as name_of_folder:
        folder, channel = Path(name_of_folder), f"127.0.0.1:{hub.port}/can0"
        bus = ('plc.can.interface="socketcand"', f'plc.can.channel="{channel}"', "plc.can.plc_timeout=20")
        keys = secured(folder) if name == "node" else []
        with served(folder / "runs", [*SETTINGS, *bus, *keys, *sets], name == "node") as place:
            began = time.monotonic()
            said = run(folder, place, ("127.0.0.1", hub.port), pegs)
            seconds = time.monotonic() - began
        with Journal(folder / "runs", is_read_only=True) as journal:
            ended = [row.outcome for row in journal.runs(2 * pegs)]
    good = ended.count(Outcome.SUCCESS)
    sys.stdout.write(f"{name}: {said}; on record {len(ended)} runs, {good} successes; {seconds:.0f} s\n")
    sys.stdout.flush()
    return good == len(ended) == pegs and re.search(rf"(done|good) {pegs}\b", said) is not None


def main() -> int:
    parser = argparse.ArgumentParser(description="Pegs by PLC-side programs that are not ours.")
    parser.add_argument("--pegs", type=int, default=100)
    parser.add_argument("--client", action="append", choices=list(WAYS), help="only this one; may be repeated")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="of the served cell's config")
    args = parser.parse_args()
    results = [insert(name, args.pegs, args.set) for name in args.client or WAYS]
    return 0 if all(results) else 1


if __name__ == "__main__":
    sys.exit(main())
