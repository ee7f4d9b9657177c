"""The map as Structured Text: a function block in PLCopen manner for the PLC's side, with every address filled in.

The text keeps to IEC 61131-3 without pointers, timers or libraries: one statement a line, so that it can be imported
as it is. Whatever Modbus client the PLC has moves the two arrays.
"""

from collections.abc import Sequence

from plc_bridge.messages import Control, Result
from plc_bridge.registers import PARAMETERS, VERSION, VERSION_MAJOR, VERSION_MINOR, Register

NO_CELL, WRONG_VERSION, STOP_PENDING = 0xFF01, 0xFF02, 0xFF03
"""ErrorID of the block's own errors."""
FAILURE_BASE = 256
"""ErrorID of a failure is this and the reason; below it are refusals, from 1000 on the fault codes."""

EXECUTE, HELD = 6, 11
"""PackML state numbers in which a run can be held, and in which it goes on."""

_DECODED = {
    "state": "State",
    "stage": "Stage",
    "reason": "Reason",
    "progress": "Progress",
    "fault": "Fault",
    "lease": "LeaseState",
    "transition": "Transition",
    "part": "Part",
}
_WIDE = {"run": "Run", "total_time": "TotalTime"}

_HEAD = """\
(* Register map {major}.{minor}, made by `cell map --format st`.
   Call the block once in every cycle. Between two calls the Modbus client of the PLC writes Command to the holding
   registers from {command_start} on, in one request (FC16), and reads Report from the input registers from
   {report_start} on, in one request (FC4). Nothing else may write Command.
   ErrorID: 1 to 255 refused, as report_refusal; {failure} + reason failed; from 1000 on fault code;
   16#{no_cell:04X} no answer from the cell; 16#{wrong_version:04X} the cell has another map;
   16#{stop_pending:04X} a stop is still on its way.
   Like every block in PLCopen manner: a rising edge of Execute starts and takes the inputs over, another one while
   Busy does nothing; exactly one of Busy, Done, Error and CommandAborted is TRUE from then on, the last three until
   Execute falls but for one cycle at least. *)
FUNCTION_BLOCK FB_InsertionCell
VAR_INPUT
    Execute : BOOL;
    Stop : BOOL; (* a rising edge stops the cell, whoever runs it *)
    Hold : BOOL; (* while TRUE the own run waits where it is *)
    Code : UINT; (* {code} *)
    Recipe : UINT; (* {recipe} *)
    SerialNumber : ARRAY[0..{last_serial}] OF BYTE; (* {serial} *)
    Parameters : ARRAY[1..{parameters}] OF DINT; (* see below *)
    ParameterMask : WORD; (* {parameter_mask} *)
    Lease : UINT; (* {lease} *)
    SilentCycles : UINT := 500; (* calls without a new report after which the cell counts as gone *)
    Report : ARRAY[0..{last_report}] OF WORD;
END_VAR
{parameter_notes}
VAR_OUTPUT
    Busy : BOOL;
    Done : BOOL;
    Error : BOOL;
    CommandAborted : BOOL;
    ErrorID : UINT;
{outputs}
    Command : ARRAY[0..{last_command}] OF WORD;
END_VAR
VAR
    Life : UINT;
    Sequence : UINT;
    RunNumber : UINT;
    StopNumber : UINT;
    HoldNumber : UINT;
    SentCode : UINT;
    Acknowledge : UINT;
    SeenLife : UINT;
    Silence : UINT;
    IsSilent : BOOL;
    IsReady : BOOL;
    IsWhole : BOOL;
    IsStopping : BOOL;
    IsHolding : BOOL;
    HoldSent : BOOL;
    WasExecute : BOOL;
    WasStop : BOOL;
    Index : INT;
END_VAR
"""

_BODY = """\
(* what was shown for one cycle may go *)
IF NOT Execute AND NOT Busy THEN
    Done := FALSE;
    Error := FALSE;
    CommandAborted := FALSE;
    ErrorID := 0;
END_IF;

(* is there a cell, and is the report whole? *)
IsWhole := Report[{r_life}] = Report[{r_life_tail}] AND Report[{r_version}] <> 0;
IF WORD_TO_UINT(Report[{r_life}]) <> SeenLife THEN
    SeenLife := WORD_TO_UINT(Report[{r_life}]);
    Silence := 0;
ELSIF Silence < SilentCycles THEN
    Silence := Silence + 1;
END_IF;
IsSilent := Silence >= SilentCycles;

(* the cell has seen this block's number; go on from what it says the last command was *)
IF IsWhole AND NOT IsReady AND WORD_TO_UINT(Report[{r_answered}]) = Sequence THEN
    Sequence := WORD_TO_UINT(Report[{r_sequence}]);
    IsReady := TRUE;
END_IF;

IF Execute AND NOT WasExecute AND NOT Busy THEN
    Done := FALSE;
    Error := FALSE;
    CommandAborted := FALSE;
    ErrorID := 0;
    IF NOT IsReady OR IsSilent THEN
        Error := TRUE;
        ErrorID := {no_cell};
    ELSIF IsStopping THEN
        Error := TRUE;
        ErrorID := {stop_pending};
    ELSIF WORD_TO_UINT(Report[{r_version}]) / 256 <> {major} THEN
        Error := TRUE;
        ErrorID := {wrong_version};
    ELSE
        IF Sequence = 65535 THEN
            Sequence := 0;
        ELSE
            Sequence := Sequence + 1;
        END_IF;
        RunNumber := Sequence;
        SentCode := Code;
        Busy := TRUE;
        Command[{c_recipe}] := UINT_TO_WORD(Recipe);
        Command[{c_parameter_mask}] := ParameterMask;
        FOR Index := 0 TO {last_serial_word} DO
            Command[{c_serial} + Index] := SHL(BYTE_TO_WORD(SerialNumber[2 * Index]), 8) OR BYTE_TO_WORD(SerialNumber[2 * Index + 1]);
        END_FOR;
        FOR Index := 1 TO {parameters} DO
            Command[{c_parameter_1} + 2 * (Index - 1)] := DWORD_TO_WORD(SHR(DINT_TO_DWORD(Parameters[Index]), 16));
            Command[{c_parameter_1} + 2 * (Index - 1) + 1] := DWORD_TO_WORD(DINT_TO_DWORD(Parameters[Index]) AND 16#FFFF);
        END_FOR;
    END_IF;
ELSIF Busy AND IsWhole THEN
    IF WORD_TO_UINT(Report[{r_sequence}]) = RunNumber AND WORD_TO_UINT(Report[{r_result}]) <> {none} THEN
        Busy := FALSE;
        Acknowledge := RunNumber;
        IF WORD_TO_UINT(Report[{r_result}]) = {success} THEN
            Done := TRUE;
        ELSIF WORD_TO_UINT(Report[{r_result}]) = {aborted} THEN
            CommandAborted := TRUE;
        ELSIF WORD_TO_UINT(Report[{r_result}]) = {failure_result} THEN
            Error := TRUE;
            ErrorID := {failure} + WORD_TO_UINT(Report[{r_reason}]);
        ELSIF WORD_TO_UINT(Report[{r_result}]) = {fault} THEN
            Error := TRUE;
            ErrorID := WORD_TO_UINT(Report[{r_fault}]);
        ELSE
            Error := TRUE;
            ErrorID := WORD_TO_UINT(Report[{r_refusal}]);
        END_IF;
    ELSIF WORD_TO_UINT(Report[{r_answered}]) = RunNumber AND WORD_TO_UINT(Report[{r_refusal}]) <> 0 THEN
        Busy := FALSE;
        Error := TRUE;
        ErrorID := WORD_TO_UINT(Report[{r_refusal}]);
    ELSIF IsStopping AND WORD_TO_UINT(Report[{r_sequence}]) = StopNumber THEN
        (* the stop overtook the command, which the cell has never seen *)
        Busy := FALSE;
        CommandAborted := TRUE;
    END_IF;
END_IF;
IF Busy AND IsSilent THEN
    Busy := FALSE;
    Error := TRUE;
    ErrorID := {no_cell};
END_IF;

(* hold and unhold: once each, when the cell is where they are permitted; they end with the run *)
IF NOT Busy THEN
    IsHolding := FALSE;
    HoldSent := FALSE;
ELSIF IsHolding AND IsWhole AND WORD_TO_UINT(Report[{r_answered}]) = HoldNumber THEN
    SentCode := 0;
    IsHolding := FALSE;
END_IF;
IF Busy AND IsWhole AND NOT IsHolding AND NOT IsStopping AND Hold <> HoldSent AND WORD_TO_UINT(Report[{r_sequence}]) = RunNumber THEN
    IF (Hold AND WORD_TO_UINT(Report[{r_state}]) = {execute_state}) OR (HoldSent AND WORD_TO_UINT(Report[{r_state}]) = {held_state}) THEN
        IF Sequence = 65535 THEN
            Sequence := 0;
        ELSE
            Sequence := Sequence + 1;
        END_IF;
        HoldNumber := Sequence;
        HoldSent := Hold;
        IsHolding := TRUE;
        IF Hold THEN
            SentCode := {hold};
        ELSE
            SentCode := {unhold};
        END_IF;
    END_IF;
END_IF;

(* a stop stays in the block until it is answered, and no longer: a new connection must not stop again *)
IF IsStopping AND IsWhole AND WORD_TO_UINT(Report[{r_answered}]) = StopNumber THEN
    SentCode := 0;
    IsStopping := FALSE;
END_IF;
IF Stop AND NOT WasStop THEN
    IF Sequence = 65535 THEN
        Sequence := 0;
    ELSE
        Sequence := Sequence + 1;
    END_IF;
    StopNumber := Sequence;
    SentCode := {stop};
    IsStopping := TRUE;
END_IF;
IF NOT Busy AND NOT IsStopping THEN
    SentCode := 0;
END_IF;
WasExecute := Execute;
WasStop := Stop;

(* the block goes out with its life counter at both ends *)
Life := Life MOD 65535 + 1;
Command[{c_life}] := UINT_TO_WORD(Life);
Command[{c_sequence}] := UINT_TO_WORD(Sequence);
Command[{c_code}] := UINT_TO_WORD(SentCode);
Command[{c_acknowledge}] := UINT_TO_WORD(Acknowledge);
Command[{c_lease}] := UINT_TO_WORD(Lease);
Command[{c_version}] := 16#{version:04X};
Command[{c_life_tail}] := UINT_TO_WORD(Life);

IF IsWhole THEN
{decoding}
END_IF;
END_FUNCTION_BLOCK
"""


def as_structured_text(registers: Sequence[Register]) -> str:
    """Return the function block `FB_InsertionCell` for this map."""
    command, report = _block(registers, "command_"), _block(registers, "report_")
    indices = {f"c_{name}": entry.address - command["life"].address for name, entry in command.items()}
    indices.update({f"r_{name}": entry.address - report["life"].address for name, entry in report.items()})
    decoded = [(shown, indices[f"r_{name}"], report[name]) for name, shown in _DECODED.items()]
    wide = [(shown, indices[f"r_{name}"], report[name]) for name, shown in _WIDE.items()]
    outputs = [f"    {name} : UINT; (* {_comment(entry)} *)" for name, _, entry in decoded]
    outputs += [f"    {name} : UDINT; (* {_comment(entry)} *)" for name, _, entry in wide]
    decoding = [f"    {name} := WORD_TO_UINT(Report[{index}]);" for name, index, _ in decoded]
    decoding += [
        f"    {name} := DWORD_TO_UDINT(SHL(WORD_TO_DWORD(Report[{index}]), 16) OR WORD_TO_DWORD(Report[{index + 1}]));"
        for name, index, _ in wide
    ]
    notes = [f"(* Parameters[{n}]: {_comment(command[f'parameter_{n}'])} *)" for n in range(1, PARAMETERS + 1)]
    comments = {name: _comment(command[name]) for name in ("code", "recipe", "serial", "parameter_mask", "lease")}
    head = _HEAD.format(
        major=VERSION_MAJOR,
        minor=VERSION_MINOR,
        command_start=command["life"].address,
        report_start=report["life"].address,
        failure=FAILURE_BASE,
        no_cell=NO_CELL,
        wrong_version=WRONG_VERSION,
        stop_pending=STOP_PENDING,
        last_serial=2 * command["serial"].words - 1,
        parameters=PARAMETERS,
        last_report=indices["r_life_tail"],
        last_command=indices["c_life_tail"],
        parameter_notes="\n".join(notes),
        outputs="\n".join(outputs),
        **comments,
    )
    body = _BODY.format(
        major=VERSION_MAJOR,
        version=VERSION,
        no_cell=NO_CELL,
        wrong_version=WRONG_VERSION,
        stop_pending=STOP_PENDING,
        failure=FAILURE_BASE,
        failure_result=Result.FAILURE.value,
        none=Result.NONE.value,
        success=Result.SUCCESS.value,
        aborted=Result.ABORTED.value,
        fault=Result.FAULT.value,
        stop=Control.STOP.value,
        hold=Control.HOLD.value,
        unhold=Control.UNHOLD.value,
        execute_state=EXECUTE,
        held_state=HELD,
        last_serial_word=command["serial"].words - 1,
        parameters=PARAMETERS,
        decoding="\n".join(decoding),
        **indices,
    )
    return head + "\n" + body


def _block(registers: Sequence[Register], prefix: str) -> dict[str, Register]:
    return {r.name.removeprefix(prefix): r for r in registers if r.name.startswith(prefix)}


def _comment(entry: Register) -> str:
    scale = f"; in {entry.scale:g} {entry.unit}" if entry.scale != 1.0 else ""
    return (entry.meaning + scale).replace("*)", "* )")
