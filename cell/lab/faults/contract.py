"""One kind of fault: how it begins and how an operator ends it."""

from collections.abc import Callable
from dataclasses import dataclass

from cell.lab.faults.bench import FaultBench
from cell.lab.faults.starts import Program

Undo = Callable[[], None]
"""Function that mends what was broken."""


def unharmed(bench: FaultBench) -> Undo:
    """Do nothing, where nothing is to be mended."""
    return lambda: None


@dataclass(frozen=True, slots=True)
class FaultKind:
    """One kind of fault."""

    name: str
    begin: Callable[[FaultBench], Undo] = unharmed
    """Function that does the harm, on the scan thread, and returns what mends it."""
    to_program: Callable[[Program], None] | None = None
    """Function that does the harm from outside, to a cell that is a program of its own; None where `begin` does it."""
    is_harmless: bool = False
    """Whether the cell has to go on as if nothing had happened."""
    ends_program: bool = False
    """Whether the program ends and is started again."""
    status: int | None = None
    """Exit status with which a program that `to_program` ends has to end; negative is the signal that killed it. None where it goes on."""
    silences_plc: bool = False
    """Whether the PLC falls silent, which the cell of this kind then notices within seconds."""
    is_record_apart: bool = False
    """Whether the record of the run is in another folder than the mended cell reads."""
    slow: str = ""
    """Reason why the arm may move for longer than a second after the fault; empty where it may not."""
