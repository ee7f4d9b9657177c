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
from typing import Any

from cell.config.files import SHIPPED
from cell.config.load import load
from drivers.skin.board_config import CanSkinConfig
from drivers.transport.can_bus import CanBus
from sim.board_links import CanCable, emulated_can
from sim.switch_board import EmulatedSwitchBoard
from tests.franka.simulated import Arm, Seen, address, served

STEP = 0.002
"""Between two looks at the boards, s."""
FILE = SHIPPED / "cell_01.toml"


class OnTheDesk(Seen):
    """The world as boards see it that have their own quartz."""

    def now(self) -> float:
        return time.monotonic()


@dataclass
class Desk:
    """Boards at their wires."""

    world: Arm
    switch: EmulatedSwitchBoard
    lock: threading.Lock
    """Of the boards, which live in a thread of their own."""
    sets: list[str]
    """What a cell's file has to say of them."""

    def pull_switch(self) -> None:
        """Pull the switch board's plug."""
        with self.lock:
            self.switch.close()

    def run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run a command of `cell` that takes a config with this desk's."""
        sets = [word for key in self.sets for word in ("--set", key)]
        command = [sys.executable, "-m", "cell", *arguments, "--config", str(FILE), *sets]
        return subprocess.run(command, capture_output=True, text=True, check=False)


@contextmanager
def desk(number: int) -> Iterator[Desk]:
    """Yield the boards; `number` tells this process's desks apart."""
    host, bus = address(number), f"239.74.163.2:{_free_port()}"
    config = load(sets=["reality.scale=0.0"]).cell
    described = CanSkinConfig(kind="can", rate=config.skin.rate)
    with served(config, host) as (world, _):
        source: Any = OnTheDesk(world)
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
