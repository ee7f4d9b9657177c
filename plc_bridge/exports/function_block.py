"""The function block for the PLC's side as data: named types, variables and body, with every address filled in.

Structured Text, PLCopen XML and Siemens SCL are three output formats, each in its own module.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from plc_bridge.exports.function_block_body import (
    DECODED,
    FAILURE_BASE,
    NO_CELL,
    RUN_GONE,
    SHOWN,
    STOP_PENDING,
    WRONG_VERSION,
    Language,
    body,
)
from plc_bridge.protocol.registers import PARAMETERS, STAGES, VERSION_MAJOR, VERSION_MINOR, Register

NAME = "FB_InsertionCell"
COMMAND, REPORT, SERIAL, PARAMETER, STAGE_TIMES, NAMES = (
    "T_CellCommand",
    "T_CellReport",
    "T_CellSerial",
    "T_CellParameters",
    "T_CellStageTimes",
    "T_CellNames",
)
"""Named types, because some compilers do not assign arrays of anonymous types."""

_BOOLS = ("IsSilent", "IsReady", "IsWhole", "IsStopping", "IsHolding", "HoldSent", "IsTaken", "WasExecute", "WasStop")
_COUNTERS = ("Life", "Sequence", "RunNumber", "StopNumber", "HoldNumber", "SentCode", "Acknowledge", "SeenLife")


@dataclass(frozen=True, slots=True)
class Variable:
    """One variable of the block."""

    name: str
    type: str
    meaning: str = ""
    initial: str = ""


@dataclass(frozen=True, slots=True)
class ArrayType:
    """A named type: an array of an elementary type."""

    name: str
    low: int
    high: int
    of: str


@dataclass(frozen=True, slots=True)
class FunctionBlock:
    """The parts of the function block that all three languages write."""

    about: str
    arrays: tuple[ArrayType, ...]
    names: Mapping[str, int]
    """Members of the type `T_CellNames`, each with its number as initial value."""
    variables: Mapping[str, tuple[Variable, ...]]
    """Variables by the keyword of their section."""
    command: Mapping[str, Register]
    """Registers of the command by their short names."""
    report: Mapping[str, Register]
    """Registers of the report by their short names."""

    def body(self, language: Language) -> str:
        """Return the statements of one cycle in a language."""
        return body([each.name for section in self.variables.values() for each in section], language)

    def sections(self, declaration: Callable[[Variable], str]) -> Iterator[str]:
        """Yield the lines of all sections of variables, with the declarations of a language."""
        for keyword, variables in self.variables.items():
            yield keyword
            yield from (f"    {declaration(each)}" for each in variables)
            yield "END_VAR"


def function_block(registers: Sequence[Register], names: Mapping[str, int]) -> FunctionBlock:
    """Return the block for this map.

    Args:
        registers: The whole map.
        names: Names of the map's numbers, see `plc_names`.
    """
    command, report = _block(registers, "command_"), _block(registers, "report_")
    return FunctionBlock(
        about=_about(command, report),
        arrays=(
            ArrayType(COMMAND, 0, _words(command) - 1, "WORD"),
            ArrayType(REPORT, 0, _words(report) - 1, "WORD"),
            ArrayType(SERIAL, 0, 2 * command["serial"].words - 1, "BYTE"),
            ArrayType(PARAMETER, 1, PARAMETERS, "DINT"),
            ArrayType(STAGE_TIMES, 1, STAGES, "TIME"),
        ),
        names=names,
        variables={
            "VAR_INPUT": _inputs(command),
            "VAR_OUTPUT": _outputs(report),
            "VAR": (
                *(Variable(name, "UINT") for name in (*_COUNTERS, *DECODED.values())),
                *(Variable(name, "BOOL") for name in _BOOLS),
                Variable("Silence", "TON"),
                Variable("Index", "INT"),
            ),
        },
        command=command,
        report=report,
    )


def _inputs(command: Mapping[str, Register]) -> tuple[Variable, ...]:
    said = {name: entry.told for name, entry in command.items()}
    notes = "; ".join(f"[{n}] {said[f'parameter_{n}']}" for n in range(1, PARAMETERS + 1))
    return (
        Variable("Execute", "BOOL", "a rising edge starts, falling acknowledges"),
        Variable("Stop", "BOOL", "a rising edge stops the cell, whoever runs it"),
        Variable("Hold", "BOOL", "while TRUE the own run waits where it is"),
        Variable("Code", "UINT", said["code"]),
        Variable("Recipe", "UINT", said["recipe"]),
        Variable("SerialNumber", SERIAL, said["serial"]),
        Variable("Parameters", PARAMETER, notes),
        Variable("ParameterMask", "UINT", said["parameter_mask"]),
        Variable("Lease", "UINT", said["lease"]),
        Variable("SilentTime", "TIME", "time without a new report after which the cell counts as gone", "T#1s"),
        Variable("Report", REPORT, "input registers of the cell, as the Modbus client has read them"),
    )


def _outputs(report: Mapping[str, Register]) -> tuple[Variable, ...]:
    return (
        *(Variable(name, "BOOL") for name in ("Busy", "Done", "Error", "CommandAborted")),
        Variable("ErrorID", "UINT", "see the head"),
        *(Variable(shown, "UINT", report[name].told) for name, shown in SHOWN.items()),
        Variable("Run", "UDINT", report["run"].told),
        Variable("TotalTime", "TIME", report["total_time"].meaning),
        Variable("StageTime", STAGE_TIMES, "time spent in each stage of the run"),
        Variable("Names", NAMES, "what the numbers are called"),
        Variable("Command", COMMAND, "holding registers of the cell, for the Modbus client to write"),
    )


def _about(command: Mapping[str, Register], report: Mapping[str, Register]) -> str:
    return f"""\
Register map {VERSION_MAJOR}.{VERSION_MINOR}, made by `cell map`.
Call the block once in every cycle. Between two calls the Modbus client of the PLC writes Command to the holding
registers from {command["life"].address} on, in one request (FC16), and reads Report from the input registers from
{report["life"].address} on, in one request (FC4). Nothing else may write Command.
ErrorID: 1 to 255 refused, as report_refusal; {FAILURE_BASE} + reason failed; from 1000 on fault code;
16#{NO_CELL:04X} no answer from the cell; 16#{WRONG_VERSION:04X} the cell has another map;
16#{STOP_PENDING:04X} a stop is still on its way; 16#{RUN_GONE:04X} the cell was started anew and does not know the run.
Like every block in PLCopen manner: a rising edge of Execute starts and takes the inputs over, another one while
Busy does nothing; exactly one of Busy, Done, Error and CommandAborted is TRUE from then on, the last three until
Execute falls but for one cycle at least."""


def _words(block: Mapping[str, Register]) -> int:
    return sum(entry.words for entry in block.values())


def _block(registers: Sequence[Register], prefix: str) -> dict[str, Register]:
    words = [r for r in registers if r.table in ("holding", "input")]
    return {r.name.removeprefix(prefix): r for r in words if r.name.startswith(prefix)}
