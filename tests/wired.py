"""A whole cell whose skin and switch stand behind their wires, at work under its supervisor, with a hand on the plugs."""

import math
from collections.abc import Callable
from itertools import count
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from cell.config.cell_config import CellConfig
from cell.config.load import LoadedConfig
from cell.devices.assembly import Cell
from cell.peg.part_state import UNRESOLVED
from cell.records.journal import Journal
from cell.run.supervisor import Supervisor
from drivers.protocols import Clock
from drivers.skin.board_config import CanSkinConfig
from drivers.skin.boards import CanSkin
from drivers.switch.board import SerialSuccessSwitch
from drivers.switch.board_config import SerialSwitchConfig
from drivers.transport.can_bus import CanBus
from plc_bridge.protocol.messages import Command, Control, PartPlace, Refusal, Report, Result
from sim.boards.board_clock import BoardClock
from sim.boards.board_links import CanCable, emulated_can
from sim.boards.switch_board import EmulatedSwitchBoard
from sim.config import WireFaults
from skills.catalogue import CATALOGUE
from tests.skins import Cabled

INSERT = CATALOGUE["insert_peg"].code
_BUSES = count()


class Wires:
    """Skin and switch as their drivers see them: python-can with an emulated hub at its end, pyserial with firmware."""

    def __init__(self, config: CellConfig, source: Any, rng: np.random.Generator) -> None:
        """Put the boards into what `source` sees of a simulated hand and hole."""
        described, name = CanSkinConfig(kind="can", rate=config.skin.rate), f"cell-{next(_BUSES)}"
        self._source = source
        self._hub = emulated_can(described, config.boards.skin, source, rng, 0)
        self._far = CanBus("virtual", name, described.bitrate)
        self.switch_board = EmulatedSwitchBoard(source)
        self.clock: Clock = BoardClock(source, (Cabled(self._hub, CanCable(self._hub, self._far)), self.switch_board))
        self.skin = CanSkin(described, CanBus("virtual", name, described.bitrate), self.clock)
        self.switch = SerialSuccessSwitch(SerialSwitchConfig(kind="serial", port=self.switch_board.port), self.clock)

    def open(self) -> None:
        self._far.open()
        self._hub.open()
        self.switch_board.open()

    def close(self) -> None:
        self.switch_board.close()
        self._far.close()

    def unplug_skin(self) -> None:
        self._hub.faults = WireFaults(unplugged=((self._source.now(), 1e6),))

    def plug_in_skin(self) -> None:
        self._hub.faults = WireFaults()


class Rehearsal:
    """A cell under its supervisor, and whoever gives it commands, in one thread: the line calls back at every scan."""

    def __init__(self, cell: Cell, loaded: LoadedConfig, folder: Path) -> None:
        """Take the opened cell, its recipes, and the folder of its journal."""
        self._journal = Journal(folder)
        self._supervisor = Supervisor(cell, loaded, self, self._journal)
        self._clock = cell.clock
        self._waiting: list[Command] = []
        self._refused: Refusal | None = None
        self._number, self._report = 0, Report(state=self._supervisor.state)
        self._due, self._stage, self._delay = math.inf, 0, 0.0
        self._action: Callable[[], None] = lambda: None

    def __enter__(self) -> "Rehearsal":
        self._journal.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._journal.close()

    def insert(self, stage: str = "", delay: float = 0.0, action: Callable[[], None] = lambda: None) -> Report:
        """Run `insert_peg` and return how it ended; so long, s, after `stage` begins, something happens.

        A person takes a peg away first that the run before left somewhere.
        """
        if self._report.part in UNRESOLVED:
            self._take_away()
        self._stage, self._delay, self._action, self._due = CATALOGUE.stage_number(stage), delay, action, math.inf
        report = self.give(INSERT)
        assert not stage or self._due == -math.inf, f"{stage} was never reached: {report}"
        return report

    def _take_away(self) -> None:
        self._number += 1
        self._waiting.append(Command(self._number, Control.CLEARED))
        self.wait(0.1)
        assert self._refused is None, f"not cleared: {self._refused}"
        assert self._report.part is PartPlace.RACK, f"cleared, and the peg is said to be {self._report.part.name}"

    def reset(self) -> Report:
        return self.give(Control.RESET)

    def wait(self, seconds: float) -> None:
        """Let the cell wait for commands for so long."""
        end = self._clock.now() + seconds
        while (before := self._clock.now()) < end:
            self._supervisor.scan()
            assert self._clock.now() > before, f"time stands still: {self._report}"

    def give(self, code: int) -> Report:
        self._number += 1
        self._waiting.append(Command(self._number, code))
        while self._report.sequence != self._number or self._report.result is Result.NONE:
            self._supervisor.scan()
            assert self._refused is None, f"{code}: {self._refused}, part {self._report.part}"
        return self._report

    # The line, as the supervisor sees it.

    def poll(self) -> Command | None:
        now = self._clock.now()
        if self._stage and self._report.stage == self._stage and self._due == math.inf:
            self._due = now + self._delay
        if math.isfinite(self._due) and now >= self._due:
            self._due = -math.inf
            self._action()
        return self._waiting.pop(0) if self._waiting else None

    def publish(self, report: Report) -> None:
        self._report = report

    def accept(self, command: Command) -> None:
        """Do nothing: the reports show the acceptance."""

    def refuse(self, command: Command, refusal: Refusal) -> None:
        self._refused = refusal
