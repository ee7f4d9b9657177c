"""One kind of fault: its cause, its repair by an operator, and the required result."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from cell.lab.faults.program import ServedProgram

if TYPE_CHECKING:
    from cell.lab.faults.bench import FaultBench

Undo = Callable[[], object]
"""Function that repairs a fault."""


def changed(thing: object, name: str, value: object) -> Undo:
    """Set an attribute, and return the function that sets it back."""
    before = getattr(thing, name)
    setattr(thing, name, value)
    return lambda: setattr(thing, name, before)


@dataclass(frozen=True, slots=True)
class FaultKind:
    """One kind of fault."""

    name: str
    begin: "Callable[[FaultBench], Undo | None]" = lambda bench: None
    """Function that causes the fault on the scan thread. It returns the function that repairs the fault, or None."""
    to_program: Callable[[ServedProgram], Undo | None] | None = None
    """Function that causes the fault from outside, in a cell that is a separate program; None if `begin` causes the fault.
    The function returns another one to call after the run, or None if it has ended the program."""
    is_timed: bool = False
    """True if the fault can delay scans: the cell then runs in real time."""
    needs_tls: bool = False
    """True if the program needs a server with TLS."""
    is_harmless: bool = False
    """True if the cell must continue without any effect."""
    status: int | None = None
    """Required exit status if the fault ends the program, which then starts again; a negative status is the signal that
    killed the program. None if the program continues."""
    silences_plc: bool = False
    """True if the PLC stops communicating; the cell then has a timeout of seconds, so that it detects the silence."""
    is_record_apart: bool = False
    """True if the run's record is in a folder that the repaired cell does not read."""
    slow: str = ""
    """Reason why the arm may move for longer than a second after the fault; empty if it must not."""

    @property
    def ends_program(self) -> bool:
        """True if the program ends and starts again."""
        return self.status is not None
