"""The body of the function block for one cycle, in Structured Text: one statement a line, with open addresses.

It uses IEC 61131-3 without pointers or libraries, except for the standard timer TON. The PLC's own Modbus client moves the
two blocks of words.
"""

BODY = """\
(* what was shown for one cycle may go *)
IF NOT Execute AND NOT Busy THEN
    Done := FALSE;
    Error := FALSE;
    CommandAborted := FALSE;
    ErrorID := 0;
END_IF;

(* is there a cell, and is the report whole? a torn one is not believed *)
IsWhole := Report[{r_life}] = Report[{r_life_tail}] AND Report[{r_version}] <> 0;
Silence(IN := WORD_TO_UINT(Report[{r_life}]) = SeenLife, PT := SilentTime);
SeenLife := WORD_TO_UINT(Report[{r_life}]);
IsSilent := Silence.Q;
IF IsWhole THEN
{decoding}
END_IF;

(* the cell has seen this block's number; go on from what it says the last command was *)
IF IsWhole AND NOT IsReady AND ReportAnswered = Sequence THEN
    Sequence := ReportSequence;
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
    ELSIF ReportVersion / 256 <> {major} THEN
        Error := TRUE;
        ErrorID := {wrong_version};
    ELSE
        Sequence := Sequence MOD 65535 + 1;
        RunNumber := Sequence;
        SentCode := Code;
        Busy := TRUE;
        IsTaken := FALSE;
        Command[{c_recipe}] := UINT_TO_WORD(Recipe);
        Command[{c_parameter_mask}] := UINT_TO_WORD(ParameterMask);
        FOR Index := 0 TO {last_serial_word} DO
            Command[{c_serial} + Index] := SHL(BYTE_TO_WORD(SerialNumber[2 * Index]), 8) OR BYTE_TO_WORD(SerialNumber[2 * Index + 1]);
        END_FOR;
        FOR Index := 1 TO {parameters} DO
            Command[{c_parameter_1} + 2 * (Index - 1)] := DWORD_TO_WORD(SHR(DINT_TO_DWORD(Parameters[Index]), 16));
            Command[{c_parameter_1} + 2 * (Index - 1) + 1] := DWORD_TO_WORD(DINT_TO_DWORD(Parameters[Index]) AND 16#FFFF);
        END_FOR;
    END_IF;
ELSIF Busy AND IsWhole THEN
    IsTaken := IsTaken OR (ReportAnswered = RunNumber AND ReportRefusal = 0);
    IF ReportSequence = RunNumber AND ReportResult <> {none} THEN
        Busy := FALSE;
        Acknowledge := RunNumber;
        IF ReportResult = {success} THEN
            Done := TRUE;
        ELSIF ReportResult = {aborted} THEN
            CommandAborted := TRUE;
        ELSIF ReportResult = {failure_result} THEN
            Error := TRUE;
            ErrorID := {failure} + Reason;
        ELSIF ReportResult = {fault} THEN
            Error := TRUE;
            ErrorID := Fault;
        ELSE
            Error := TRUE;
            ErrorID := ReportRefusal;
        END_IF;
    ELSIF ReportAnswered = RunNumber AND ReportRefusal <> 0 THEN
        Busy := FALSE;
        Error := TRUE;
        ErrorID := ReportRefusal;
    ELSIF IsStopping AND ReportSequence = StopNumber THEN
        (* the stop overtook the command, which the cell has never seen *)
        Busy := FALSE;
        CommandAborted := TRUE;
    ELSIF ReportAnswered = Sequence AND (ReportSequence <> RunNumber OR ReportCode = 0) AND NOT IsStopping AND NOT IsHolding THEN
        (* the cell has answered the newest number and knows no run of this block any more: it was started anew *)
        Busy := FALSE;
        Error := TRUE;
        ErrorID := {run_gone};
    END_IF;
    IF Error AND IsTaken AND ErrorID = {adopted} THEN
        (* the cell had taken the command and takes its number for a first one now: it was started anew *)
        ErrorID := {run_gone};
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
ELSIF IsHolding AND IsWhole AND ReportAnswered = HoldNumber THEN
    SentCode := 0;
    IsHolding := FALSE;
END_IF;
IF Busy AND IsWhole AND NOT IsHolding AND NOT IsStopping AND Hold <> HoldSent AND ReportSequence = RunNumber THEN
    IF (Hold AND State = {execute_state}) OR (HoldSent AND State = {held_state}) THEN
        Sequence := Sequence MOD 65535 + 1;
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
IF IsStopping AND IsWhole AND ReportAnswered = StopNumber THEN
    SentCode := 0;
    IsStopping := FALSE;
END_IF;
IF Stop AND NOT WasStop THEN
    Sequence := Sequence MOD 65535 + 1;
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
"""
