"""Brings the arm of a cell to rest, by a request to the running skill or directly by a halt."""

import logging
from collections.abc import Callable

from cell.devices.assembly import Cell
from drivers.errors import CellError
from skills.contract import Request, SkillContext

logger = logging.getLogger(__name__)


def fault_of(act: Callable[[], None]) -> CellError | None:
    """Call a function and return the fault that it raised, or None; an internal error becomes a fault too."""
    try:
        act()
    except CellError as error:
        return error
    except (Exception, SystemExit) as error:  # an error inside this program must stop the arm like any other fault
        logger.exception("error inside this program")
        return CellError(f"{type(error).__name__}: {error}".replace("\n", " "))
    return None


class Brake:
    """Brings one arm to rest; only `halt` may be called from another thread than the scan's."""

    def __init__(self, cell: Cell, context: SkillContext) -> None:
        """Keep the opened cell and its skill context."""
        self._cell, self._context = cell, context
        self.request = Request.RUN
        """Request that the running skill reads at its next scan."""
        self.resumed = 0.0
        """Time of the last `resume` on the cell's clock, s."""

    @property
    def is_at_rest(self) -> bool:
        """True if the arm is at rest."""
        return self._context.lead.rest.is_reached

    def ask(self, request: Request) -> None:
        """Request a hold or a stop from the skill, and start to check whether the arm has come to rest."""
        self.request = request
        self._context.lead.rest.seek(self._cell.clock.now())

    def resume(self) -> None:
        """Request that the skill returns the arm to where it was held, and continues."""
        self.request, self.resumed = Request.RESUME, self._cell.clock.now()

    def halt(self) -> None:
        """Halt the arm unless it is at rest: after a halt, an arm sinks by the error of its gravity model."""
        if self.is_at_rest:
            return
        try:
            self._cell.arm.halt()
        except CellError as error:
            logger.error("the arm could not be halted: %s", error)

    def wait(self, meanwhile: Callable[[], None] = lambda: None) -> CellError | None:
        """Wait until the arm is at rest, calling `meanwhile` at each scan; after a fault, halt the arm and return the fault."""

        def act() -> None:
            self._context.lead.rest.wait(self._cell.clock, self._context.schedule.period, meanwhile)

        fault = fault_of(act)
        if fault is not None:
            self.halt()
        return fault
