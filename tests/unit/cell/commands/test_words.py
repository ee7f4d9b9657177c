import pytest

from cell.commands.words import line, report
from cell.run.states import BEFORE_RESET, State
from drivers.errors import FAULTS, FaultCode
from plc_bridge.protocol.images import Diagnostics
from plc_bridge.protocol.messages import PartEvidence, PartPlace, Report


def told(**fields):
    return report(Report(**fields))["next"]


def test_a_technician_at_a_faulted_cell_reads_what_is_broken_and_where_the_peg_goes():
    skin = FAULTS[FaultCode.SKIN_SILENT].remedy
    assert (
        told(state=State.ABORTED, fault=1001, part=PartPlace.IN_HAND)
        == f"{skin}, then reset; then the hand holds a peg: `cell run recover`"
    )
    assert (
        told(state=State.ABORTED, fault=1001, part=PartPlace.RACK)
        == f"{skin}, then reset; then the next peg is in the rack"
    )


@pytest.mark.parametrize("fault", [code for code in FaultCode if code])
def test_after_every_fault_the_reset_comes_before_the_peg(fault):
    steps = told(state=State.ABORTED, fault=fault, part=PartPlace.IN_HAND)
    assert steps.count("reset") == 1
    assert steps.index("reset") < steps.index("`cell run recover`")


def test_no_reset_is_asked_for_where_the_state_needs_none():
    assert told(state=State.IDLE, fault=1001, part=PartPlace.RACK) == (
        "check the board's supply and cable; then the next peg is in the rack"
    )


@pytest.mark.parametrize("state", BEFORE_RESET)
def test_a_cell_that_was_stopped_is_not_called_ready(state):
    assert told(state=state, part=PartPlace.BIN) == "reset; then the last peg is in the reject bin"


def test_a_cell_that_waits_is_ready():
    assert told(state=State.IDLE, part=PartPlace.RACK) == "ready: the next peg is in the rack"


def test_place_and_what_to_do_stand_in_the_same_line():
    words = line(Report(state=State.ABORTED, fault=2001, part=PartPlace.ON_PLATE), Diagnostics())
    assert "part=on_plate" in words
    assert "next=find out why, release the stop, then reset; then a peg lies on the plate" in words
    assert "\n" not in words


def test_where_the_peg_is_why_and_what_to_do_follow_each_other_in_the_line():
    evidence = PartEvidence.HAND_HOLDS | PartEvidence.TIP_IN_HOLE | PartEvidence.SWITCH_OPEN
    image = Report(
        state=State.ABORTED,
        fault=2001,
        part=PartPlace.IN_HOLE,
        part_depth=0.012,
        part_evidence=evidence,
        part_width=0.008,
    )
    assert (
        "part=in_hole part_depth=0.012 evidence=the hand holds a peg, its end was in the hole, switch open, pads 8.0 mm apart next="
        in line(image, Diagnostics())
    )
