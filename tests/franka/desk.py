"""The boards of a physical cell on a desk: `python -m tests.franka.desk [run insert_peg]` runs that command of `cell` with them.

`config/cell_01.toml` is the cell's file, with nothing replaced but the addresses: a skin hub on a CAN bus between
processes, the switch's firmware on an emulated chip behind a serial port, an arm and its hand at an address of the
loopback. The boards keep wall time; the world behind them goes as fast as the arm's states leave, one a millisecond
where the machine is quick enough, and a cell that expects a second to be a second notices where it is not.
"""

import json
import math
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cell.config.files import SHIPPED
from cell.config.load import load
from drivers.quantities import Vector
from drivers.skin.board_config import CanSkinConfig
from drivers.transport.can_bus import CanBus
from sim.boards.board_links import CanCable, emulated_can
from sim.boards.switch_board import EmulatedSwitchBoard
from tests.franka.simulated import Arm, Seen, address, served

STEP = 0.002
"""Between two looks at the boards, s."""
FILE = SHIPPED / "cell_01.toml"
PUSH = 15.0
"""Force of a finger, N."""


@dataclass
class Person:
    """Pushes the hand and presses the lever every other half second, when asked to."""

    is_pushing: bool = False
    is_pressing: bool = False

    def push(self) -> Vector:
        """Return the force on the hand, shape (3,), N."""
        return np.array([0.0, PUSH * (self.is_pushing and _is_time()), 0.0])


def _is_time() -> bool:
    return time.monotonic() % 1.0 < 0.5


class OnTheDesk(Seen):
    """The world as boards see it that have their own quartz."""

    def __init__(self, arm: Arm, person: Person) -> None:
        super().__init__(arm)
        self._person = person

    def now(self) -> float:
        return time.monotonic()

    def is_switch_pressed(self) -> bool:
        return (self._person.is_pressing and _is_time()) or super().is_switch_pressed()


@dataclass
class Desk:
    """Boards at their wires."""

    world: Arm
    switch: EmulatedSwitchBoard
    lock: threading.Lock
    """Of the boards, which live in a thread of their own."""
    sets: list[str]
    """What a cell's file has to say of them."""
    person: Person
    file: Path = FILE
    """The cell's file."""

    def pull_switch(self) -> None:
        """Pull the switch board's plug."""
        with self.lock:
            self.switch.close()

    def run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run a command of `cell` that takes a config with this desk's."""
        return subprocess.run(self._command(*arguments), capture_output=True, text=True, check=False)

    def prove(self) -> str:
        """Run `cell check --prove`, do what it asks for, and return its standard output."""
        pipe = subprocess.PIPE
        with subprocess.Popen(self._command("check", "--prove", "--json"), stdin=pipe, stdout=pipe, stderr=pipe) as run:
            assert run.stdin is not None
            assert run.stdout is not None
            assert run.stderr is not None
            asked = b""
            while letter := run.stderr.read(1):
                asked += letter
                if asked.endswith(b": ") and b"Enter" in asked:
                    self.person.is_pushing, self.person.is_pressing = b"push" in asked, b"lever" in asked
                    asked = b""
                    run.stdin.write(b"\n")
                    run.stdin.flush()
            self.person.is_pushing = self.person.is_pressing = False
            return run.stdout.read().decode()

    def _command(self, *arguments: str) -> list[str]:
        sets = [word for key in self.sets for word in ("--set", key)]
        return [sys.executable, "-m", "cell", *arguments, "--config", str(self.file), *sets]


@contextmanager
def desk(number: int) -> Iterator[Desk]:
    """Yield the boards; `number` distinguishes this process's desks."""
    host, bus = address(number), f"239.74.163.2:{_free_port()}"
    config = load(sets=["reality.scale=0.0"]).cell
    described = CanSkinConfig(kind="can", rate=config.skin.rate)
    with served(config, host) as (world, _):
        person = Person()
        source: Any = OnTheDesk(world, person)
        world.push = person.push
        hub = emulated_can(described, config.boards.skin, source, source.draw.skin, 0)
        far, switch = CanBus("udp_multicast", bus, described.bitrate), EmulatedSwitchBoard(source)
        cable, lock, is_over = CanCable(hub, far), threading.Lock(), threading.Event()

        def live() -> None:
            while not is_over.wait(STEP):
                with lock:
                    cable.advance()
                    hub.advance()
                    switch.advance()

        switch.terminal.is_read_meanwhile = True
        far.open()
        hub.open()
        switch.open()
        world.horizon = math.inf
        thread = threading.Thread(target=live)
        thread.start()
        try:
            yield Desk(
                world,
                switch,
                lock,
                [
                    f"arm.host={host}",
                    "arm.realtime=ignore",
                    f"gripper.host={host}",
                    "skin.interface=udp_multicast",
                    f"skin.channel={bus}",
                    f"switch.port={switch.port}",
                    "plc.modbus.port=0",
                ],
                person,
            )
        finally:
            is_over.set()
            thread.join()
            switch.close()
            far.close()


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port: int = free.getsockname()[1]
        return port


def main() -> None:
    """Run one command against the boards and say what the world then is like."""
    with desk(9) as boards:
        began, simulated = time.monotonic(), boards.world.now()
        done = boards.run(*(sys.argv[1:] or ["check"]))
        print(done.stdout, done.stderr, sep="", end="")
        truth = boards.world.world.truth()
        told = {
            "status": done.returncode,
            "switch_closed": bool(truth.switch_closed),
            "depth": truth.depth,
            "wall": time.monotonic() - began,
            "simulated": boards.world.now() - simulated,
        }
        print(json.dumps(told))


if __name__ == "__main__":
    main()
