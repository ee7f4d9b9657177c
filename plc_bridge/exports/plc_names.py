"""Names of every number of the map, as PLC programs use them: RESULT_SUCCESS, REFUSAL_BUSY, CODE_INSERT_PEG."""

import re
from collections.abc import Mapping

from drivers.errors import FaultCode
from plc_bridge.protocol.messages import CONTROLS, LeaseState, PartEvidence, PartPlace, Refusal, Result
from plc_bridge.protocol.registers import Lease


def plc_names(programs: Mapping[int, str], words: Mapping[str, Mapping[int, str]]) -> dict[str, int]:
    """Return the number of each name.

    Args:
        programs: Name of each program and skill by its command code.
        words: Meanings of the numbers in a register, by the register's name, for registers that the cell defines.
    """
    names = {_name("CODE", control.name): control.value for control in sorted(CONTROLS)}
    names.update({_name("CODE", program): code for code, program in programs.items()})
    for kind, members in (
        ("RESULT", Result),
        ("REFUSAL", Refusal),
        ("LEASE", LeaseState),
        ("PART", PartPlace),
        ("EVIDENCE", PartEvidence),
        ("ASK_LEASE", Lease),
    ):
        names.update({_name(kind, str(member.name)): member.value for member in members})
    for register, said in words.items():
        kind = register.removeprefix("report_").upper()
        names.update({_name(kind, word): number for number, word in said.items()})
    names.update({_name("FAULT", fault.name): fault.value for fault in FaultCode})
    return names


def _name(kind: str, word: str) -> str:
    """Return an identifier of IEC 61131-3: letters, digits and single underscores."""
    return re.sub(r"[^A-Z0-9]+", "_", f"{kind}_{word}".upper()).strip("_")
