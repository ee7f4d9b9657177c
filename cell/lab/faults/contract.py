"""One kind of fault: its start, its repair by an operator, and the required result."""

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
    """Function that causes the fault on the scan thread, and returns its repair; None if it needs none."""
    to_program: Callable[[ServedProgram], Undo | None] | None = None
    """Function that causes the fault from outside, in a cell that is a separate program; None if `begin` causes it. It
    returns the function to call after the run; None if the program has been ended."""
    is_timed: bool = False
    """True if the fault can delay scans: the cell then runs in real time."""
    needs_tls: bool = False
    """True if the program needs a server with TLS."""
    is_harmless: bool = False
    """True if the cell must continue without any effect."""
    status: int | None = None
    """Required exit status of a program that the fault ends, after which it starts again; negative is the signal that
    killed it. None if the program continues."""
    silences_plc: bool = False
    """True if the PLC falls silent; the cell of this kind detects this within seconds."""
    is_record_apart: bool = False
    """True if the run's record is in another folder than the repaired cell reads."""
    slow: str = ""
    """Reason why the arm may move for longer than a second after the fault; empty if it must not."""

    @property
    def ends_program(self) -> bool:
        """True if the program ends and starts again."""
        return self.status is not None
