"""The campaign of faults with a few cases, and its counts."""

import json
from collections import Counter
from dataclasses import replace

import pytest

from cell.config.load import load
from cell.lab.faults import ends, tables
from cell.lab.faults.bench import KEYS, REST_LIMIT, bench
from cell.lab.faults.cases import STAGES, TABLE, WENT_ON, FaultCase, begun, planned
from cell.lab.faults.contract import FaultKind
from cell.lab.faults.kinds import KINDS
from cell.lab.faults.measure import measure
from cell.lab.faults.soak import SoakGroup, earlier, pieces, soak
from cell.lab.rows import write_rows
from cell.records.provenance import versions
from drivers.errors import ConfigError, FaultCode
from plc_bridge.protocol.messages import Control, LeaseState

BY_NAME = {kind.name: kind for kind in KINDS}
KIND = BY_NAME["skin: unplugged"]
HONEST = (*KEYS, "sim.pace=max", "sim.seed=97950", "hole.area=[0.02,0.02]")


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
    cycle=0.01,
)
COUNTED = tuple(tables.COUNTED)


def program_case(kind, folder):
    words = [word for key in (*KEYS, "sim.seed=97950") for word in ("--set", key)]
    return ends.tried(kind, "grasp_from_rack", 1.5, words, folder / "journal")


def test_a_signal_leaves_the_arm_at_rest_and_the_run_on_record(tmp_path):
    for run in (1, 2):  # the second finds the records of the first, whose peg nobody has found since
        if run == 2:
            file = tmp_path / "journal" / "part-sim.json"
            file.write_text(json.dumps({**json.loads(file.read_text()), "place": "UNKNOWN"}))
        case = program_case(BY_NAME["process: SIGHUP"], tmp_path)
        assert (case.outcome, case.reason, case.part in {"rack", "in_hand"}) == ("aborted", "stopped", True), run
        assert case.rest_after < 1.0
        assert (case.record, case.part_untrue, case.is_back) == (True, False, True)


def test_a_program_that_does_not_end_in_time_is_no_sound_case(tmp_path, monkeypatch):
    monkeypatch.setattr(ends, "ENDING", 0.1)
    deaf = FaultKind("process: deaf", to_program=lambda program: None, status=0)
    assert not program_case(deaf, tmp_path).record


def test_a_program_whose_disk_was_full_warns_and_goes_on(tmp_path):
    case = program_case(BY_NAME["disk: full, then room again"], tmp_path)
    assert (case.record, case.part_untrue, case.is_back) == (True, False, True)


def test_a_slice_of_the_campaign_has_zeros_where_there_must_be(tmp_path):
    """A fault of the arm and one of a skill; `cell study faults` tries all kinds at all stages.

    Of an arm that takes no setpoint when the peg is nearly in, no distance reveals it: the hand stands where the setpoint
    is, which goes on so slowly that it is not 61 mm away for 79 s.
    """
    tried = [(BY_NAME["arm: deaf"], "spiral_adjust", 0.3), (BY_NAME["skill: lies"], "grasp_from_rack", 1.5)]
    cases = list(measure(lambda number: load(sets=list(HONEST)), tried, tmp_path))
    line = tables.lines(cases, load().cell.limits.force)[-1]
    assert line["n"] == len(tried)
    # Where the peg is after the fault depends on how far the peg had come, and so on the computer's load.
    assert line["part unknown"] <= 1
    zero = {name: line[name] for name in COUNTED if "late" not in name and name != "part unknown"}
    assert zero == dict.fromkeys(zero, 0)
    deaf, _ = cases
    assert (deaf.outcome, deaf.fault, deaf.state) == ("fault", FaultCode.TRACKING, "ABORTED")
    assert deaf.detection <= 0.5
    assert deaf.rest < REST_LIMIT


def test_the_plc_of_the_campaign_stays_connected_between_workpieces():
    sets = [*KEYS, "reality.scale=0.0", "sim.pace=max", "plc.modbus.idle_timeout=1.0"]
    with bench(load(sets=sets)) as tested:
        tested.let_pass(30.0)
        assert tested.peer.trigger(Control.RESET).lease == LeaseState.YOURS


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


@pytest.mark.parametrize(
    "kind", ["plc: killed", "switch: never", "skill: lies", "arm: place drifts", "skin: a frame in twenty lost"]
)
def test_a_fault_that_cannot_show_at_once_may_take_longer(kind):
    rows = [replace(SOUND, kind=kind, rest_after=3.0)]
    assert tables.lines(rows, 60.0)[-1]["late after"] == 0


@pytest.mark.parametrize("number", [1, len(KINDS), len(KINDS) + 5])
def test_each_kind_of_fault_is_drawn_once_before_one_is_drawn_twice(number):
    tried = planned(KINDS, number, 7)
    assert tried == planned(KINDS, number, 7)
    counts = Counter(kind.name for kind, _, _ in tried)
    assert len(tried) == number
    assert max(counts.values()) - (min(counts.values()) if len(counts) == len(KINDS) else 0) <= 1


def test_each_kind_of_fault_is_drawn_at_every_stage_before_one_again():
    tried = planned(KINDS, len(KINDS) * len(STAGES), 7)
    assert set(Counter((kind.name, stage) for kind, stage, _ in tried).values()) == {1}
    assert all(first <= moment <= last for _, stage, moment in tried for first, last in [STAGES[stage]])


def test_a_campaign_that_was_broken_off_goes_on_where_it_was(tmp_path):
    tried = [(KIND, "spray_search", 0.3), (KIND, "spray_search", 1.0)]
    rows = [replace(SOUND, kind=KIND.name)]
    assert begun(tried, tmp_path) == []
    write_rows(rows, tmp_path / TABLE)
    assert begun(tried, tmp_path) == rows
    assert begun(list(reversed(tried)), tmp_path) == []
    write_rows([replace(row, code="other") for row in rows], tmp_path / TABLE)
    assert begun(tried, tmp_path) == []


def test_a_run_that_ended_before_the_fault_is_not_counted():
    assert tables.lines([replace(SOUND, outcome="not reached")], 60.0)[-1]["n"] == 0


BEGAN = "2026-01-01T10:00:00+00:00"
GROUP = SoakGroup(1, versions()["code"], BEGAN, 0.0, 0.0, "insert", "success", 100.0, 20, 5)


def group(number, **changes):
    """Return a group of the soak; each took 0.05 h."""
    return replace(GROUP, wall=0.05 * number, hours=float(number), **changes)


def test_growth_is_counted_after_caches_are_filled_beside_the_gaps():
    """Memory that comes in the first quarter and stays is none; a handle at every look after it is."""
    first = [group(n, memory=100.0 if n < 2 else 130.0, handles=20 + max(n - 5, 0)) for n in range(20)]
    one, two = pieces([*first, group(1, piece=2, began=BEGAN.replace("10:", "12:"))])
    assert (one.memory, one.handles, one.threads) == pytest.approx((0.0, 1.0, 0.0), abs=1e-9)
    assert (one.gap, one.wall, two.gap) == pytest.approx((0.0, 0.95, 1.05))


def test_groups_are_counted_by_their_endings():
    endings = ["success", "failure", "success", "fault", "CellSilentError: no answer"]
    (piece,) = pieces([group(n, ending=ending) for n, ending in enumerate(endings)])
    assert (piece.groups, piece.seated, piece.failed, piece.lost) == (5, 2, 1, 2)


def test_pieces_of_other_code_are_not_continued(tmp_path):
    write_rows([group(1)], tmp_path / "soak.csv")
    assert len(earlier(tmp_path / "soak.csv")) == 1
    write_rows([group(1, code="other")], tmp_path / "soak.csv")
    with pytest.raises(ConfigError, match="pieces of other code"):
        earlier(tmp_path / "soak.csv")


def test_a_piece_of_the_soak_inserts_after_every_group_of_commands():
    (first,) = soak(load(sets=list(HONEST)), piece=1, hours=1e-6, seed=3)
    assert first.ending in WENT_ON
