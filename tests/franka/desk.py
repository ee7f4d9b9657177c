"""The boards of a physical cell on a desk: `python -m tests.franka.desk` opens a shell in which `cell` finds them.

The shell's folder holds the cell's file, `config/cell_01.toml` with the desk's addresses: a skin hub on a CAN bus between
processes, the switch's firmware on an emulated chip behind a serial port, an arm and its hand at an address of the
loopback. Everything keeps the time of the world behind the boards, the cell too, and the world waits for the cell: a busy
computer makes all of it slower.

Files in that folder are what a person does: `push` contains a force on the hand, N along x, y and z; `lever` presses the
lever of the switch; `rod` contains the angle of a rod in the closed fingers, degrees; `empty` takes the pegs out of the rack,
which else has one in every slot.
"""

import json
import math
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from franka_sim.server import state_stream

from cell.calibrate.skin import ROD_HALF
from cell.config.files import SHIPPED
from cell.config.load import load
from drivers.quantities import Vector
from drivers.skin.board_config import CanSkinConfig
from drivers.transport.can_bus import CanBus
from sim.boards.board_links import emulated_can
from sim.boards.switch_board import EmulatedSwitchBoard
from sim.hand.bench import CalibrationBench
from sim.world.situation import PegSituation
from tests.franka.simulated import Arm, Seen, address, served
from tests.skins import Cabled

STEP = 0.002
"""Time between two looks of the boards, s."""
LOOK = 0.01
"""Time between two looks of the person, s of wall time."""
FILE = "cell_01.toml"
CONFIG = load(sets=["reality.scale=0.0", "arm.model=fr3"]).cell
"""The world behind the boards."""


class Person:
    """Pushes, presses, holds a rod and fills the rack."""

    def __init__(self, folder: Path, world: Arm) -> None:
        """Take the folder of the files, and the world."""
        self._folder, self._world = folder, world
        self._bench = CalibrationBench(CONFIG.peg.part.thickness, ROD_HALF)
        self.force, self.is_pressing = np.zeros(3), False
        world.push = lambda: self.force

    def rod(self) -> Any:
        """Return the load of the rod on the pads; None without a rod."""
        return self._bench.pad_load()

    def look(self) -> None:
        """Act as the files state, and put a peg into the slot under the hand."""
        self.force = self._numbers("push", 3)
        self.is_pressing = (self._folder / "lever").exists()
        if (self._folder / "rod").exists():
            self._bench.hold(math.radians(self._numbers("rod", 1)[0]))
        else:
            self._bench.release()
        with self._world.lock:
            if not (self._folder / "empty").exists():
                self._fill()
            elif self._world.world.peg is PegSituation.FREE:
                self._world.world.lose()

    def _numbers(self, name: str, count: int) -> Vector:
        try:
            found = np.array([float(word) for word in (self._folder / name).read_text(encoding="utf-8").split()])
        except (OSError, ValueError):
            return np.zeros(count)
        return found if found.shape == (count,) else np.zeros(count)

    def _fill(self) -> None:
        """Fill the slot under the hand. The world has one peg: it is taken from where it is, unless it is in use."""
        world, rack = self._world.world, CONFIG.rack
        apart = world.tcp().position - np.array(rack.first)
        slot = round(apart[1] / rack.pitch)
        is_above = 0 <= slot < rack.slots and np.hypot(apart[0], apart[1] - slot * rack.pitch) < rack.pitch / 2.0
        if not is_above or apart[2] < CONFIG.peg.length or world.peg is PegSituation.HELD:
            return
        mouth = np.array(rack.first[:2]) + np.array([0.0, slot * rack.pitch])
        is_there = world.peg is PegSituation.FREE and math.dist(world.peg_pose().position[:2], mouth) < rack.pitch / 2.0
        if not is_there and not world.truth().is_in_hole:
            world.restock(CONFIG.job(slot=slot), 0)


class OnTheDesk(Seen):
    """The world as the boards see it, with a person beside it."""

    def __init__(self, arm: Arm, person: Person) -> None:
        super().__init__(arm)
        self._person = person

    def pad_load(self) -> Any:
        return self._person.rod() or super().pad_load()

    def is_switch_pressed(self) -> bool:
        return self._person.is_pressing or super().is_switch_pressed()


@dataclass
class Desk:
    """Boards at their wires, and a folder with the cell's file."""

    folder: Path
    world: Arm

    @property
    def environment(self) -> dict[str, str]:
        """Environment of a command of `cell`."""
        here = Path(__file__)
        paths = str(here.parent / "desk_time"), str(here.parents[2]), os.environ.get("PYTHONPATH", "")
        scripts = str(Path(sys.executable).parent), os.environ.get("PATH", "")
        return {
            **os.environ,
            "DESK_TIME": str(self.folder / "time"),
            "PYTHONPATH": os.pathsep.join(filter(None, paths)),
            "PATH": os.pathsep.join(scripts),
            "XDG_DATA_HOME": str(self.folder / "data"),
        }

    def write(self, lines: str) -> None:
        """Enter lines of the form of a config file into the cell's file."""
        file = self.folder / FILE
        text = file.read_text(encoding="utf-8")
        for section, keys in tomllib.loads(lines).items():
            for key, value in keys.items():
                text = _entered(text, section, key, json.dumps(value))
        file.write_text(text, encoding="utf-8")


def _entered(text: str, section: str, key: str, value: str) -> str:
    """Return a config's text with one key replaced or added."""
    head, _, body = text.partition(f"[{section}]\n")
    kept, mark, rest = body.partition("\n[")
    rows = [row for row in kept.rstrip().splitlines() if row.split(" = ")[0] != key]
    return f"{head.rstrip()}\n\n[{section}]\n" + "\n".join([*rows, f"{key} = {value}", ""]) + mark + rest


@contextmanager
def desk(number: int, folder: Path) -> Iterator[Desk]:
    """Yield the boards, with the cell's file in `folder`; `number` distinguishes this process's desks."""
    host, bus = address(number), f"239.74.163.2:{_free_port(socket.SOCK_DGRAM)}"
    described = CanSkinConfig(kind="can", rate=CONFIG.skin.rate)
    for name in (FILE, "sim.toml"):
        shutil.copy(SHIPPED / name, folder)
    with (folder / FILE).open("a", encoding="utf-8") as file:
        file.write(f"\n[plc.modbus]\nport = {_free_port(socket.SOCK_STREAM)}\n")
    # The desk keeps the time of its world, which goes as fast as this computer can.
    with patch.object(state_stream, "_MIN_STATE_SPACING", 0.0), served(CONFIG, host) as (world, server):
        server.is_hurried = True
        world.shown = np.memmap(folder / "time", dtype=float, mode="w+", shape=2)
        world.shown[:] = world.now(), math.inf
        person = Person(folder, world)
        source: Any = OnTheDesk(world, person)
        hub = emulated_can(described, CONFIG.boards.skin, source, source.draw.skin, 0)
        far, switch = CanBus("udp_multicast", bus, described.bitrate), EmulatedSwitchBoard(source)
        skin, is_over = Cabled(hub, far), threading.Event()

        due = world.now()

        def advance() -> None:
            nonlocal due
            if world.now() >= due:
                due = world.now() + STEP
                skin.advance()
                switch.advance()

        def live() -> None:
            while not is_over.wait(LOOK):
                person.look()
                for _ in range(round(LOOK / world.world.arm.control_period)):
                    if not world.has_client():
                        world.step()

        switch.terminal.is_read_meanwhile = True
        far.open()
        hub.open()
        switch.open()
        world.after = advance
        thread = threading.Thread(target=live)
        thread.start()
        boards = Desk(folder, world)
        boards.write(
            f'[arm]\nhost = "{host}"\nrealtime = "ignore"\n[gripper]\nhost = "{host}"\n'
            f'[skin]\ninterface = "udp_multicast"\nchannel = "{bus}"\n[switch]\nport = "{switch.port}"\n'
        )
        try:
            yield boards
        finally:
            is_over.set()
            thread.join()
            switch.close()
            far.close()


def _free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as free:
        free.bind(("127.0.0.1", 0))
        port: int = free.getsockname()[1]
        return port


def main() -> None:
    """Open a shell, or run the given command in its place, and print the state of the world at its end."""
    with tempfile.TemporaryDirectory() as folder, desk(9, Path(folder)) as boards:
        began, simulated = time.monotonic(), boards.world.now()
        done = subprocess.run(
            sys.argv[1:] or [os.environ.get("SHELL", "sh")], cwd=folder, env=boards.environment, check=False
        )
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
