"""The body of the function block for one cycle, in Structured Text with placeholders.

Each line has one statement. `body` replaces the placeholders of variables, registers and numbers by the texts of a
`Language`. The statements use IEC 61131-3 without pointers or libraries, except for the standard timer TON. The PLC's own
Modbus client transfers the two blocks of words.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from plc_bridge.protocol.messages import Control, Refusal, Result
from plc_bridge.protocol.registers import STAGES, VERSION, VERSION_MAJOR

NO_CELL, WRONG_VERSION, STOP_PENDING, RUN_GONE = 0xFF01, 0xFF02, 0xFF03, 0xFF04
"""ErrorID of the block's own errors."""
FAILURE_BASE = 256
"""First ErrorID of failures, to which the reason is added; refusals are below it, and fault codes start at 1000."""
_NUMBERS = {
    "NO_CELL": NO_CELL,
    "WRONG_VERSION": WRONG_VERSION,
    "STOP_PENDING": STOP_PENDING,
    "RUN_GONE": RUN_GONE,
    "FAILURE_BASE": FAILURE_BASE,
    "VERSION_MAJOR": VERSION_MAJOR,
    "EXECUTE": 6,  # PackML state in which a run can be held
    "HELD": 11,  # PackML state in which it can continue
}
DECODED = {
    "version": "ReportVersion",
    "sequence": "ReportSequence",
    "answered": "ReportAnswered",
    "result": "ReportResult",
    "refusal": "ReportRefusal",
    "code": "ReportCode",
}
"""Registers of the report for the block's internal use, and the variables for their decoded values."""
SHOWN = {
    "state": "State",
    "stage": "Stage",
    "reason": "Reason",
    "progress": "Progress",
    "fault": "Fault",
    "refusal_detail": "RefusalDetail",
    "lease": "LeaseState",
    "transition": "LastTransition",
    "part": "Part",
    "part_evidence": "PartEvidence",
    "part_width": "PartWidth",
}
"""Registers of the report that are outputs of the block."""
_INPUTS = {"recipe": "Recipe", "parameter_mask": "ParameterMask"}
_SENT = {
    "life": "Life",
    "sequence": "Sequence",
    "code": "SentCode",
    "acknowledge": "Acknowledge",
    "lease": "Lease",
    "version": f"16#{VERSION:04X}",
    "life_tail": "Life",
}
"""Registers of the command, and the variables for their values: a start sets `_INPUTS`, every cycle sets `_SENT`."""
BODY = """\
(* what was shown for one cycle may go *)
IF NOT {Execute} AND NOT {Busy} THEN
    {Done} := FALSE;
    {Error} := FALSE;
    {CommandAborted} := FALSE;
    {ErrorID} := 0;
END_IF;

(* is there a cell, and is the report whole? a torn one is not believed *)
{IsWhole} := {word[life]} = {word[life_tail]} AND {word[version]} <> 0;
{Silence}(IN := {number[life]} = {SeenLife}, PT := {SilentTime});
{SeenLife} := {number[life]};
{IsSilent} := {Silence}.Q;
IF {IsWhole} THEN
{decoding}
END_IF;

(* the cell has seen this block's number; go on from what it says the last command was *)
IF {IsWhole} AND NOT {IsReady} AND {ReportAnswered} = {Sequence} THEN
    {Sequence} := {ReportSequence};
    {IsReady} := TRUE;
END_IF;

IF {Execute} AND NOT {WasExecute} AND NOT {Busy} THEN
    {Done} := FALSE;
    {Error} := FALSE;
    {CommandAborted} := FALSE;
    {ErrorID} := 0;
    IF NOT {IsReady} OR {IsSilent} THEN
        {Error} := TRUE;
        {ErrorID} := {NO_CELL};
    ELSIF {IsStopping} THEN
        {Error} := TRUE;
        {ErrorID} := {STOP_PENDING};
    ELSIF {ReportVersion} / 256 <> {VERSION_MAJOR} THEN
        {Error} := TRUE;
        {ErrorID} := {WRONG_VERSION};
    ELSE
        {Sequence} := {Sequence} MOD 65535 + 1;
        {RunNumber} := {Sequence};
        {SentCode} := {Code};
        {Busy} := TRUE;
        {IsTaken} := FALSE;
{inputs}
    END_IF;
ELSIF {Busy} AND {IsWhole} THEN
    {IsTaken} := {IsTaken} OR ({ReportAnswered} = {RunNumber} AND {ReportRefusal} = 0);
    IF {ReportSequence} = {RunNumber} AND {ReportResult} <> {Result.NONE} THEN
        {Busy} := FALSE;
        {Acknowledge} := {RunNumber};
        IF {ReportResult} = {Result.SUCCESS} THEN
            {Done} := TRUE;
        ELSIF {ReportResult} = {Result.ABORTED} THEN
            {CommandAborted} := TRUE;
        ELSIF {ReportResult} = {Result.FAILURE} THEN
            {Error} := TRUE;
            {ErrorID} := {FAILURE_BASE} + {Reason};
        ELSIF {ReportResult} = {Result.FAULT} THEN
            {Error} := TRUE;
            {ErrorID} := {Fault};
        ELSE
            {Error} := TRUE;
            {ErrorID} := {ReportRefusal};
        END_IF;
    ELSIF {ReportAnswered} = {RunNumber} AND {ReportRefusal} <> 0 THEN
        {Busy} := FALSE;
        {Error} := TRUE;
        {ErrorID} := {ReportRefusal};
    ELSIF {IsStopping} AND {ReportSequence} = {StopNumber} THEN
        (* the stop overtook the command, which the cell has never seen *)
        {Busy} := FALSE;
        {CommandAborted} := TRUE;
    ELSIF {ReportAnswered} = {Sequence} AND ({ReportSequence} <> {RunNumber} OR {ReportCode} = 0) AND NOT {IsStopping} AND NOT {IsHolding} THEN
        (* the cell has answered the newest number and knows no run of this block any more: it was started anew *)
        {Busy} := FALSE;
        {Error} := TRUE;
        {ErrorID} := {RUN_GONE};
    END_IF;
    IF {Error} AND {IsTaken} AND {ErrorID} = {Refusal.ADOPTED} THEN
        (* the cell had taken the command and takes its number for a first one now: it was started anew *)
        {ErrorID} := {RUN_GONE};
    END_IF;
END_IF;
IF {Busy} AND {IsSilent} THEN
    {Busy} := FALSE;
    {Error} := TRUE;
    {ErrorID} := {NO_CELL};
END_IF;

(* hold and unhold: once each, when the cell is where they are permitted; they end with the run *)
IF NOT {Busy} THEN
    {IsHolding} := FALSE;
    {HoldSent} := FALSE;
ELSIF {IsHolding} AND {IsWhole} AND {ReportAnswered} = {HoldNumber} THEN
    {SentCode} := 0;
    {IsHolding} := FALSE;
END_IF;
IF {Busy} AND {IsWhole} AND NOT {IsHolding} AND NOT {IsStopping} AND {Hold} <> {HoldSent} AND {ReportSequence} = {RunNumber} THEN
    IF ({Hold} AND {State} = {EXECUTE}) OR ({HoldSent} AND {State} = {HELD}) THEN
        {Sequence} := {Sequence} MOD 65535 + 1;
        {HoldNumber} := {Sequence};
        {HoldSent} := {Hold};
        {IsHolding} := TRUE;
        IF {Hold} THEN
            {SentCode} := {Control.HOLD};
        ELSE
            {SentCode} := {Control.UNHOLD};
        END_IF;
    END_IF;
END_IF;

(* a stop stays in the block until it is answered, and no longer: a new connection must not stop again *)
IF {IsStopping} AND {IsWhole} AND {ReportAnswered} = {StopNumber} THEN
    {SentCode} := 0;
    {IsStopping} := FALSE;
END_IF;
IF {Stop} AND NOT {WasStop} THEN
    {Sequence} := {Sequence} MOD 65535 + 1;
    {StopNumber} := {Sequence};
    {SentCode} := {Control.STOP};
    {IsStopping} := TRUE;
END_IF;
IF NOT {Busy} AND NOT {IsStopping} THEN
    {SentCode} := 0;
END_IF;
{WasExecute} := {Execute};
{WasStop} := {Stop};

(* the block goes out with its life counter at both ends *)
{Life} := {Life} MOD 65535 + 1;
{block}
"""


@dataclass(frozen=True, slots=True)
class Language:
    """The parts of the body that differ between the languages."""

    sign: str
    """Sign before each variable of the block."""
    words: Mapping[str, str]
    """Expression for each register of the report."""
    numbers: Mapping[str, str]
    """Expression for each register of the report as UINT or, if the register has two words, as UDINT."""
    stage_time: str
    """Expression for the time of the stage `Index` as UDINT."""
    sending: Mapping[str, str]
    """Statement that sets each register of the command, with braces for the value."""
    arrays: Sequence[str]
    """Statements that set the serial number and the parameters."""


def body(variables: Sequence[str], language: Language) -> str:
    """Return the body in a language, with these names of the block's variables."""
    of = {name: f"{language.sign}{name}" for name in variables}
    numbers, index = language.numbers, of["Index"]
    decoding = [f"{of[shown]} := {numbers[name]};" for name, shown in (DECODED | SHOWN).items()]
    decoding += [
        f"{of['Run']} := {numbers['run']};",
        f"{of['TotalTime']} := T#1ms * UDINT_TO_DINT({numbers['total_time']});",
        f"FOR {index} := 1 TO {STAGES} DO",
        f"    {of['StageTime']}[{index}] := T#1ms * UDINT_TO_DINT({language.stage_time});",
        "END_FOR;",
    ]
    inputs = [language.sending[name].format(of[value]) for name, value in _INPUTS.items()]
    block = [language.sending[name].format(of.get(value, value)) for name, value in _SENT.items()]
    return BODY.format(
        decoding="\n".join(f"    {line}" for line in decoding),
        inputs="\n".join(f"        {line}" for line in (*inputs, *language.arrays)),
        block="\n".join(block),
        word=language.words,
        number=numbers,
        **of,
        **_NUMBERS,
        Control=Control,
        Refusal=Refusal,
        Result=Result,
    )
