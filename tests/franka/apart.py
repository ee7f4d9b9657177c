"""Arm, hand, their server and their world in a process of their own, so that nothing the cell computes holds their states up."""

import math
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from multiprocessing import get_context
from multiprocessing.managers import BaseManager
from typing import Any

from cell.config.cell_config import CellConfig
from drivers.parts import Job
from sim.world.line import SimLine
from skills.catalogue import RECOVER
from tests.franka.simulated import Seen, served


class _Standing:
    """Clock of a line whose acts take no time; the cell waits for them."""

    def now(self) -> float:
        return 0.0

    def wait_until(self, stamp: float) -> None: ...


class Bench:
    """Simulated devices behind the wires of one cell; the cell's process calls every method."""

    def __init__(self, config: CellConfig, host: str) -> None:
        """Serve arm and hand on `host`, an address of the loopback."""
        self._stack = ExitStack()
        self._arm, self._server = self._stack.enter_context(served(config, host))
        self._seen = Seen(self._arm)
        self._line = SimLine(self._arm.world, _Standing(), config.params(RECOVER).bin)

    def close(self) -> None:
        self._stack.close()

    def now(self) -> float:
        return self._seen.now()

    def wait_until(self, stamp: float) -> None:
        self._seen.wait_until(stamp)

    def let_go(self) -> None:
        """Let the world go on with every state requested, independent of the cell."""
        self._arm.horizon = math.inf

    def pad_load(self) -> Any:
        return self._seen.pad_load()

    def is_switch_pressed(self) -> bool:
        return self._seen.is_switch_pressed()

    def skin_noise(self) -> Any:
        return self._seen.draw.skin

    def stock(self, job: Job, seed: int) -> None:
        """Set up a run; see `SimLine`."""
        self._arm.between_steps(self._line.stock)(job, seed)

    def act(self, name: str) -> None:
        self._arm.between_steps(getattr(self._line, name))()

    def cut(self) -> None:
        """End the arm's connection from its side."""
        self._server.cut()

    def truth(self) -> Any:
        with self._arm.lock:
            return self._arm.world.truth()

    def largest_rate(self) -> float:
        """Return the largest change of a torque command within one millisecond so far, N·m/s."""
        return self._arm.largest_rate


class _Manager(BaseManager):
    """Starts the process and passes the calls on."""


_Manager.register("Bench", Bench)


@contextmanager
def bench(config: CellConfig, host: str) -> Iterator[Any]:
    """Yield a `Bench` in a process of its own."""
    with _Manager(ctx=get_context("spawn")) as manager:
        made = manager.Bench(config, host)  # type: ignore[attr-defined]  # registered above
        try:
            yield made
        finally:
            made.close()
