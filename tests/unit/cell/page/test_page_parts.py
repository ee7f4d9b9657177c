"""Content and inputs of the page, without a browser and without a cell."""

import math
import re
from dataclasses import replace

import pytest

from cell.config.parameters import PARAMETERS
from cell.page import telling
from cell.page.commands import Ask, BadAskError, parse
from cell.page.guard import refusal
from cell.page.hub import PageHub
from cell.page.records import Records, shift
from cell.page.token import FILE, is_token, page_token
from cell.page.traces import NAMES, POINTS, STEP, Traces, touch
from cell.run.line import CONTROLS, PROGRAMS
from cell.run.live import KEPT, CablePull, Live, Look
from cell.run.states import TRANSITIONS, Event, State
from drivers.errors import FAULTS, ConfigError, FaultCode
from plc_bridge.bridge import Bridge
from plc_bridge.protocol.messages import Control, PartEvidence, PartPlace, Refusal, Report
from plc_bridge.protocol.registers import Lease
from skills.catalogue import CATALOGUE
from tests.fakes import Rig
from tests.trouble import full_disk


@pytest.fixture
def look(rig: Rig) -> Look:
    return Look(rig.cell.context(0).observe(), "spray_search", 1, 0.1)


def later(look: Look, time: float, **what) -> Look:
    return replace(look, seen=replace(look.seen, stamp=look.seen.stamp + time), **what)


def test_only_existing_simulated_cables_are_pulled(loaded, tmp_path):
    ask = parse('{"ask": "unplug", "cable": "skin"}')
    assert (ask.cable, ask.is_out) == ("skin", True)
    assert parse('{"ask": "plug", "cable": "skin"}') == Ask(cable="skin")
    live, pull = Live(), CablePull("skin", True, "page")
    bridge = Bridge(loaded.cell.plc, PROGRAMS, PARAMETERS)
    real, simulated = (PageHub(bridge, live, loaded, Records(tmp_path), "", names) for names in ((), ("skin",)))
    assert "its devices are real" in real.pull(pull)
    assert "skin allowed" in simulated.pull(replace(pull, cable="arm"))
    assert live.pulls() == []
    pulls = [pull, replace(pull, is_out=False)]
    assert [simulated.pull(each) for each in pulls] == ["", ""]
    assert (live.pulls(), live.pulls()) == (pulls, [])


WITHOUT_SWITCH = (
    r"Plug in what was pulled out: switch\. The part: peg in hand \(hand grips 8\.0 mm\): the hand holds a peg: "
    r"start the program recover\. Then.*"
)
ON_PLATE = (
    r".*The part: peg on plate \(fell from 20\.0 mm above the plate\): a peg lies on the plate or below it: "
    r'a person must take it away, then press "Peg taken away"\.'
)


@pytest.mark.parametrize(
    ("state", "part", "evidence", "unplugged", "words"),
    [
        (State.ABORTED, PartPlace.RACK, "", ["skin"], r"Plug in what was pulled out: skin\..*"),
        (State.EXECUTE, PartPlace.RACK, "", ["skin"], r"((?!Plug in).)*"),
        (State.IDLE, PartPlace.IN_HAND, "hand grips 8.0 mm", ["switch"], WITHOUT_SWITCH),
        (State.COMPLETE, PartPlace.IN_HAND, "hand grips 8.0 mm", ["switch"], WITHOUT_SWITCH),
        (State.IDLE, PartPlace.ON_PLATE, "", [], r".*a person must take it away.*"),
        (State.EXECUTE, PartPlace.ON_PLATE, "", [], r"((?!part).)*"),
        (State.ABORTED, PartPlace.ON_PLATE, "fell from 20.0 mm above the plate", [], ON_PLATE),
    ],
)
def test_the_next_steps_are_the_cables_and_then_the_part(state, part, evidence, unplugged, words):
    told = telling.told(Report(state=state, part=part), "", evidence, unplugged)
    assert re.fullmatch(words, told["next"])
    assert told["unplugged"] == unplugged
    assert ("start" in told["permitted"]) == (state in (State.IDLE, State.COMPLETE) and not unplugged)


def test_a_full_slot_drops_the_oldest_look_and_never_grows(look):
    live = Live()
    for number in range(KEPT + 5):
        live.show(replace(look, run=number))
    assert [taken.run for taken in live.take()] == list(range(5, KEPT + 5))
    assert live.take() == []


def test_a_trace_is_thinned_out_and_bounded(look):
    traces = Traces()
    points = traces.add(later(look, 0.01 * number) for number in range(101))
    assert [point[0] for point in points] == pytest.approx([STEP * number for number in range(21)])
    traces.add(later(look, STEP * number) for number in range(100, POINTS + 200))
    assert len(traces.points) == POINTS


def test_another_run_begins_another_trace_at_time_zero(look):
    traces = Traces()
    traces.add([look, later(look, 1.0)])
    assert [point[0] for point in traces.add([later(look, 9.0, run=2)])] == [0.0]
    assert (traces.run, len(traces.points)) == (2, 1)


def test_only_stages_at_the_hole_have_a_depth(look):
    depth = NAMES.index("depth")
    searching, grasping = (
        Traces().add([replace(look, stage=name)])[0][depth] for name in ("spray_search", "grasp_from_rack")
    )
    assert searching == pytest.approx(0.1 - look.seen.tip[2], abs=1e-6)
    assert grasping is None


def test_an_infinite_value_is_null_in_json(look):
    blind = replace(look.seen, peg=replace(look.seen.peg, healthy=False, sigma=math.inf, stamp=-math.inf))
    told = touch(replace(look, seen=blind))
    assert (told["theta"], told["sigma"], told["theta_age"]) == (None, None, None)


@pytest.mark.parametrize("state", list(State))
def test_every_state_permits_what_the_table_of_states_permits(state):
    asked = {event for (before, event) in TRANSITIONS if before is state and event is not Event.FINISHED}
    if state is State.ABORTED:
        asked.add(Event.RESET)
    if state is State.COMPLETE:
        asked.add(Event.START)
    by_person = set(telling.BY_PERSON) if state in telling.WAITING else set()
    assert set(telling.permitted(state)) == {event.value for event in asked} | by_person


@pytest.mark.parametrize("code", [code for code in FAULTS if code is not FaultCode.NONE])
def test_every_fault_comes_with_meaning_cause_and_remedy(code):
    fault = telling.told(Report(state=State.ABORTED, fault=code), "skin: silent", "")["fault"]
    assert (fault["message"], fault["remedy"]) == ("skin: silent", FAULTS[code].remedy)


def test_every_refusal_that_a_page_can_meet_has_words():
    met = set(Refusal) - {Refusal.NONE, Refusal.VERSION, Refusal.TORN, Refusal.ADOPTED, Refusal.LATE}
    assert set(telling.REFUSED) == met


def test_the_yield_counts_runs_that_have_ended():
    told = shift({"running": 1, "success": 1, "failure": 1})
    assert (told["runs"], told["yield"]) == (2, 0.5)
    assert told["counts"] == {"success": 1, "failure": 1, "aborted": 0, "fault": 0}
    assert shift({})["yield"] is None
    assert shift({"lost": 1})["counts"]["lost"] == 1


def test_a_start_becomes_the_command_block_of_a_plc():
    image = parse('{"ask": "start", "program": "insert_peg", "recipe": 1, "serial": "PN7[a]-[/x]"}').command
    assert (image.code, image.recipe, image.serial) == (CATALOGUE["insert_peg"].code, 1, "PN7[a]-[/x]")
    assert parse('{"ask": "hold"}').command.code == Control.HOLD
    assert parse('{"ask": "release"}').lease == Lease.RELEASE


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (b"\xff", "not JSON"),
        ("[1]", "an object"),
        ('{"ask": ["hold"]}', "unlock, take, release, start"),
        ('{"ask": "acknowledge"}', "unlock, take, release, start"),
        ('{"ask": "start", "program": "dance"}', "insert_peg"),
        ('{"ask": "start", "program": "insert_peg", "recipe": true}', "a whole number from 0 to 65535"),
        ('{"ask": "start", "program": "insert_peg", "recipe": 65536}', "a whole number from 0 to 65535"),
        ('{"ask": "start", "program": "insert_peg", "serial": "\\u00e4"}', "printable ASCII"),
        ('{"ask": "start", "program": "insert_peg", "serial": 7}', "serial: a text"),
        ('{"ask": "unlock", "token": null}', "token: a text"),
        ('{"ask": "unplug", "cable": 1}', "cable: a text"),
    ],
)
def test_an_invalid_request_is_refused_with_what_is_allowed(text, why):
    with pytest.raises(BadAskError, match=why.replace("(", "\\(")):
        parse(text)


@pytest.mark.parametrize(
    ("host", "is_answered"),
    [
        *((own, True) for own in ("127.0.0.1:8080", "localhost", "[::1]:8080", "192.168.0.7:80", "[fe80::1]")),
        *((other, False) for other in ("", "evil.example", "evil.example:8080", "127.0.0.1.evil.example")),
        *((broken, False) for broken in ("[::1", "[x]:1")),
    ],
)
def test_addresses_and_own_names_are_answered_and_others_not(host, is_answered):
    assert bool(refusal(host, None)) is not is_answered


def test_the_token_is_made_once_for_its_owner_alone(tmp_path):
    token = page_token(tmp_path / "journal")
    assert page_token(tmp_path / "journal") == token
    assert (tmp_path / "journal" / FILE).stat().st_mode & 0o777 == 0o600
    assert is_token(token, token)
    assert not any(is_token(other, token) for other in ("", token[:-1], None, 7, "ä"))
    (tmp_path / "journal" / FILE).chmod(0o644)
    with pytest.raises(ConfigError, match="only its owner allowed"):
        page_token(tmp_path / "journal")


@pytest.mark.parametrize("text", [b"", b"\n", b"short", b"\xff" * 30, b"\x00" * 30])
def test_a_token_that_anybody_could_guess_is_made_anew(tmp_path, text):
    (tmp_path / FILE).write_bytes(text)
    (tmp_path / FILE).chmod(0o600)
    token = page_token(tmp_path)
    assert len(token) == 24
    assert page_token(tmp_path) == token


def test_a_full_disk_leaves_no_token_behind(tmp_path):
    with full_disk(), pytest.raises(ConfigError, match="cannot be used"):
        page_token(tmp_path)
    assert list(tmp_path.iterdir()) == []
    assert len(page_token(tmp_path)) == 24


@pytest.mark.parametrize(
    ("state", "place", "evidence", "labels"),
    [
        (State.EXECUTE, PartPlace.IN_HAND, 0, []),
        (State.HELD, PartPlace.IN_HAND, 0, ["Unhold"]),
        (State.ABORTED, PartPlace.IN_HOLE, 0, ["Reset", "Recover the peg", "Peg taken away"]),
        (State.STOPPED, PartPlace.RACK, 0, ["Reset"]),
        (State.IDLE, PartPlace.UNKNOWN, 0, ["Peg taken away"]),
        (State.IDLE, PartPlace.RACK, 0, []),
        (State.COMPLETE, PartPlace.SEATED, PartEvidence.HAND_EMPTY, ["Peg taken away"]),
        (State.COMPLETE, PartPlace.SEATED, PartEvidence.HAND_HOLDS, ["Recover the peg", "Peg taken away"]),
    ],
)
def test_every_next_step_of_a_person_is_a_button(state, place, evidence, labels):
    steps = telling.told(Report(state=state, part=place, part_evidence=evidence), "", "")["steps"]
    assert [step["label"] for step in steps] == labels
    assert all(step["ask"] in {*CONTROLS, "start"} for step in steps)
    assert [step["ask"] for step in telling.own(Report(refusal=Refusal.RACK_EMPTY))["steps"]] == ["refilled"]
    assert telling.own(Report())["steps"] == []
