"""Bringing the arm of a cell to rest: what a skill is asked to do, and the halt that needs no skill."""

import logging
from collections.abc import Callable

from cell.assembly import Cell
from drivers.errors import CellError
from skills.contract import Request, SkillContext

logger = logging.getLogger(__name__)


def fault_of(act: Callable[[], None]) -> CellError | None:
    """Do something, and return what broke, an error inside this program too, as the fault that the line reads."""
    try:
        act()
    except CellError as error:
        return error
    except Exception as error:  # an error inside this program must stop the arm like any other fault
        logger.exception("error inside this program")
        return CellError(f"{type(error).__name__}: {error}".replace("\n", " "))
    return None


class Brake:
    """Brings one arm to rest; for the scan thread, but for `halt`."""

    def __init__(self, cell: Cell, context: SkillContext) -> None:
        """Take the opened cell and the context of its skills."""
        self._cell, self._context = cell, context
        self.request = Request.RUN
        """What the skill under way is asked at its next scan."""
        self._since = 0.0

    @property
    def is_at_rest(self) -> bool:
        """Whether the arm stands."""
        return self._context.rest.is_reached

    def ask(self, request: Request) -> None:
        """Ask the skill to hold or to stop, and look from now on whether the arm has come to rest."""
        self.request = request
        self._context.rest.seek(self._cell.clock.now())

    def resume(self) -> None:
        """Ask the skill to lead the arm back from a hold."""
        self.request, self._since = Request.RESUME, self._cell.clock.now()

    def led_back(self, stamp: float) -> float:
        """Return for how long the arm has been led back at a time of the cell's clock, s."""
        return stamp - self._since

    def halt(self) -> None:
        """Halt the arm, whatever state it is in; one at rest would only sink again by what its model of gravity lacks."""
        if self.is_at_rest:
            return
        try:
            self._cell.arm.halt()
        except CellError as error:
            logger.error("the arm does not take the halt: %s", error)

    def wait(self, meanwhile: Callable[[], None] = lambda: None) -> CellError | None:
        """Wait until the arm stands, and do something at each scan; what breaks meanwhile is returned, and the arm halted."""

        def act() -> None:
            self._context.rest.wait(self._cell.clock, self._context.scan_period, meanwhile)

        fault = fault_of(act)
        if fault is not None:
            self.halt()
        return fault
