"""The campaign of faults, with one case of it: what must hold on any computer holds."""

import csv
import math
from collections import Counter
from dataclasses import replace

import pytest

from cell.config.load import load
from cell.lab.faults import charts, ends, kills, tables
from cell.lab.faults.bench import KEYS, REST_LIMIT, bench
from cell.lab.faults.cases import FaultCase, begun, write
from cell.lab.faults.contract import FaultKind
from cell.lab.faults.kinds import KINDS
from cell.lab.faults.measure import MOMENTS, cases, drawn, measure
from cell.lab.faults.soak import SoakSample, growth
from cell.run.states import State
from drivers.errors import CellError, FaultCode
from sim.config import WireFaults

KIND = next(kind for kind in KINDS if kind.name == "skin: unplugged")
SOUND = FaultCase(
    kind="arm: reflex",
    stage="spray_search",
    moment=0.3,
    outcome="fault",
    reason="none",
    fault=2002,
    state="ABORTED",
    part="in_hand",
    detection=0.01,
    rest=0.1,
    rest_after=0.11,
    creep=0.0002,
    peak_force=20.0,
    contact_force=10.0,
    wrong_success=False,
    part_untrue=False,
    record=True,
    reset="success",
    actions=0,
    following="success",
)
COUNTED = (
    "wrong successes",
    "late rest",
    "late after",
    "over force",
    "disturbed",
    "part untrue",
    "part unknown",
    "no record",
    "not back",
)


def test_an_unplugged_skin_ends_the_run_at_rest_on_record_and_production_goes_on():
    seen = []
    (case,) = measure(
        lambda number: load(sets=[*KEYS, "reality.scale=0.0", "sim.pace=max"]),
        [(KIND, "grasp_from_rack", 0.3)],
        seen.append,
    )
    assert seen == [case]
    assert (case.outcome, case.fault, case.state) == ("fault", FaultCode.SKIN_SILENT, "ABORTED")
    assert case.rest < REST_LIMIT
    assert (case.record, case.wrong_success, case.is_back) == (True, False, True)


def test_an_arm_whose_readings_cannot_be_true_ends_the_run_at_once_and_on_record():
    kinds = {kind.name: kind for kind in KINDS}
    tried = [
        ("arm: readings still", "spiral_adjust", FaultCode.ARM_SILENT),
        ("arm: readings still", "spray_search", FaultCode.ARM_SILENT),
        ("arm: force beyond any sensor", "spiral_adjust", FaultCode.NOT_FINITE),
        ("arm: stamp no number", "tactile_insert", FaultCode.NOT_FINITE),
    ]
    found = measure(
        lambda number: load(sets=[*KEYS, "reality.scale=0.0", "sim.pace=max"]),
        [(kinds[name], stage, 0.3) for name, stage, _ in tried],
        lambda case: None,
    )
    for case, (_, _, code) in zip(found, tried, strict=True):
        assert (case.outcome, case.fault, case.state) == ("fault", code, "ABORTED")
        assert case.detection <= 0.2
        assert (case.record, case.wrong_success, case.is_back) == (True, False, True)


def test_a_program_that_a_signal_ends_has_its_arm_at_rest_and_its_run_on_record():
    hangup = next(kind for kind in KINDS if kind.name == "process: SIGHUP")
    words = [word for key in (*KEYS, "sim.seed=97950") for word in ("--set", key)]
    case = ends.tried(hangup, "grasp_from_rack", 1.5, words)
    assert (case.outcome, case.reason, case.part) == ("aborted", "stopped", "rack")
    assert case.rest_after < 1.0
    assert (case.record, case.part_untrue, case.is_back) == (True, False, True)


def test_a_program_that_does_not_end_when_it_is_asked_to_is_no_sound_case(monkeypatch):
    monkeypatch.setattr(ends, "ENDING", 0.1)
    deaf = FaultKind("process: deaf", to_program=lambda program: None, ends_program=True, status=0)
    words = [word for key in (*KEYS, "sim.seed=97950") for word in ("--set", key)]
    assert not ends.tried(deaf, "grasp_from_rack", 1.5, words).record


def test_an_arm_that_takes_no_setpoint_when_the_peg_is_nearly_in_is_told_within_half_a_second():
    """No distance tells it: the hand stands where the setpoint is, which goes on so slowly that it is not 61 mm away for 79 s."""
    deaf = next(kind for kind in KINDS if kind.name == "arm: deaf")
    (case,) = measure(
        lambda number: load(sets=[*KEYS, "sim.pace=max", "sim.seed=97950"]),
        [(deaf, "spiral_adjust", 0.3)],
        lambda case: None,
    )
    assert (case.outcome, case.fault) == ("fault", FaultCode.TRACKING)
    assert case.detection < 0.5
    assert (case.record, case.wrong_success, case.part_untrue, case.is_back) == (True, False, False, True)


def test_a_slice_of_the_campaign_has_zeros_where_there_must_be(tmp_path):
    """One fault of each device, at as many stages; `cell study faults` tries all kinds at all stages."""
    slice_of = {
        "disk: read-only": ("grasp_from_rack", 3.0),
        "arm: silent": ("spray_search", 1.8),
        "skin: fingers swapped": ("tactile_insert", 0.4),
        "skill: lies": ("grasp_from_rack", 1.5),
    }
    tried = [(kind, *slice_of[kind.name]) for kind in KINDS if kind.name in slice_of]
    rows = measure(lambda number: load(sets=[*KEYS, "sim.pace=max", "sim.seed=97950"]), tried, lambda case: None)
    assert len(rows) == len(slice_of)
    line = tables.lines(rows, load().cell.limits.force)[-1]
    assert {name: line[name] for name in COUNTED if "late" not in name} == dict.fromkeys(COUNTED[:1] + COUNTED[3:], 0)


@pytest.mark.parametrize(
    ("change", "column"),
    [
        ({"wrong_success": True}, "wrong successes"),
        ({"rest": 0.31}, "late rest"),
        ({"rest_after": 1.01}, "late after"),
        ({"peak_force": 73.0}, "over force"),
        ({"contact_force": 73.0}, "over force"),
        ({"kind": "plc: two at once"}, "disturbed"),
        ({"part_untrue": True}, "part untrue"),
        ({"part": "unknown"}, "part unknown"),
        ({"record": False}, "no record"),
        ({"following": "fault"}, "not back"),
        ({"actions": 2}, "not back"),
    ],
)
def test_each_shortfall_is_counted_in_its_own_column(change, column):
    line = tables.lines([replace(SOUND, **change)], force_limit=60.0)[-1]
    assert {name: line[name] for name in COUNTED} == {name: int(name == column) for name in COUNTED}


@pytest.mark.parametrize("kind", ["plc: killed", "switch: never", "skill: lies"])
def test_what_nobody_can_know_at_once_may_take_longer(kind):
    rows = [replace(SOUND, kind=kind, rest_after=3.0)]
    assert tables.lines(rows, 60.0)[-1]["late after"] == 0


@pytest.mark.parametrize("number", [1, len(KINDS), len(KINDS) + 5])
def test_of_cases_that_are_drawn_each_kind_comes_once_before_one_comes_twice(number):
    tried = drawn(cases(KINDS), number, 7)
    assert tried == drawn(cases(KINDS), number, 7)
    counts = Counter(kind.name for kind, _, _ in tried)
    assert len(tried) == number
    assert max(counts.values()) - (min(counts.values()) if len(counts) == len(KINDS) else 0) <= 1


def test_of_cases_that_are_drawn_each_kind_comes_at_every_stage_before_it_comes_to_one_again():
    tried = drawn(cases(KINDS), len(KINDS) * len(MOMENTS), 7)
    assert set(Counter((kind.name, stage) for kind, stage, _ in tried).values()) == {1}


def test_a_campaign_that_was_broken_off_goes_on_where_it_was(tmp_path):
    tried = [(KIND, "spray_search", 0.3), (KIND, "spray_search", 1.0)]
    rows = [replace(SOUND, kind=KIND.name)]
    assert begun(tried, tmp_path) == []
    write(rows, tmp_path)
    assert begun(tried, tmp_path) == rows
    assert begun(list(reversed(tried)), tmp_path) == []


def test_a_run_that_ended_before_the_fault_is_not_counted():
    assert tables.lines([replace(SOUND, outcome="not reached")], 60.0)[-1]["n"] == 0


def test_every_kind_is_tried_at_every_stage():
    assert len(cases(KINDS)) == 20 * len(KINDS) >= 1000


@pytest.fixture(scope="module")
def idle():
    """Yield a served cell that nobody commands yet."""
    with bench(load(sets=[*KEYS, "reality.scale=0.0", "sim.pace=max"])) as tried:
        tried.peer.close()
        yield tried


def stand_aborted(tried, away):
    """Unplug the skin for so long, s of the cell's clock, and wait until the cell stands aborted, as a PLC finds it that comes later."""
    tried.wire.faults = WireFaults(unplugged=((0.0, tried.cell.clock.now() + away),))
    while tried.supervisor.state is not State.ABORTED:
        tried.let_pass(0.1)


def test_a_cell_that_no_reset_brings_back_is_given_up(idle, monkeypatch):
    monkeypatch.setattr(kills, "PAUSE", 0.0)
    stand_aborted(idle, 1e5)
    seen = kills.Seen()
    with pytest.raises(CellError, match=rf"fault {FaultCode.SKIN_SILENT} after {kills.RESETS} resets"):
        kills.insert(idle.bridge.address, 1, seen=seen)
    assert (seen.run, seen.resets) == (0, kills.RESETS)


def test_a_cell_that_stands_aborted_from_its_start_is_reset_and_counted(idle):
    stand_aborted(idle, 5.0)
    seen = kills.insert(idle.bridge.address, 1)
    assert (seen.run, seen.aborted) == (1, FaultCode.SKIN_SILENT)
    assert seen.resets >= 1


def test_growth_is_counted_once_caches_are_filled():
    """Memory that comes in the first quarter and stays is none; a handle at every look after it is."""
    found = [
        SoakSample(float(n), n, n, 0, 0, "", memory=100.0 if n < 2 else 130.0, handles=20 + max(n - 5, 0), threads=5)
        for n in range(20)
    ]
    assert growth(found) == pytest.approx((0.0, 1.0, 0.0), abs=1e-9)


def test_table_and_chart_are_written(tmp_path):
    charts.draw([SOUND, replace(SOUND, kind="skin: frozen", rest_after=math.nan)], tmp_path / charts.CHART)
    with write([SOUND], tmp_path).open() as file:
        (row,) = csv.DictReader(file)
    assert row["kind"] == "arm: reflex"
    assert (tmp_path / charts.CHART).stat().st_size > 10_000
