"""The next steps after a fault are remedy, reset and peg, in this order."""

import pytest

from cell.commands.words import line, report
from cell.run.states import BEFORE_RESET, State
from drivers.errors import FAULTS, FaultCode
from plc_bridge.protocol.messages import Diagnostics, PartEvidence, PartPlace, Report


def told(**fields):
    return report(Report(**fields))["next"]


@pytest.mark.parametrize(
    ("state", "fault", "part", "steps"),
    [
        (State.ABORTED, 1001, PartPlace.IN_HAND, "{skin}, then reset; then the hand holds a peg: `cell run recover`"),
        (State.ABORTED, 1001, PartPlace.RACK, "{skin}, then reset; then the next peg is in the rack"),
        (State.IDLE, 1001, PartPlace.RACK, "check the board's supply and cable; then the next peg is in the rack"),
        *((state, 0, PartPlace.BIN, "reset; then the last peg is in the reject bin") for state in BEFORE_RESET),
        (State.IDLE, 0, PartPlace.RACK, "ready: the next peg is in the rack"),
    ],
)
def test_the_next_steps_are_remedy_reset_and_peg(state, fault, part, steps):
    skin = FAULTS[FaultCode.SKIN_SILENT].remedy
    assert told(state=state, fault=fault, part=part) == steps.format(skin=skin)


@pytest.mark.parametrize("fault", [code for code in FaultCode if code])
def test_after_every_fault_the_reset_comes_before_the_peg(fault):
    steps = told(state=State.ABORTED, fault=fault, part=PartPlace.IN_HAND)
    assert steps.count("reset") == 1
    assert steps.index("reset") < steps.index("`cell run recover`")


def test_one_line_has_place_evidence_and_remedy():
    evidence = PartEvidence.HAND_HOLDS | PartEvidence.TIP_IN_HOLE | PartEvidence.SWITCH_OPEN
    place = {"part": PartPlace.IN_HOLE, "part_depth": 0.012, "part_evidence": evidence, "part_width": 0.008}
    words = line(Report(state=State.ABORTED, fault=2001, **place), Diagnostics())
    assert (
        "part=in_hole part_depth=0.012 evidence=the hand holds a peg, its end was in the hole, switch open, "
        "pads 8.0 mm apart next=find out why, release the stop, then reset; then " in words
    )
    assert "\n" not in words
