"""The study of the wires: what it measures must be possible."""

from cell.lab.trials import COLUMNS, TrialRow
from cell.lab.wire import switch_wire
from cell.lab.wire.measure import compared, decode_rates, latencies
from drivers.switch.board import REOPEN_PERIOD
from tests.emulation import emulated_or_skip


def test_every_wire_is_decoded_faster_than_it_can_carry():
    lines = decode_rates(300)
    assert {line.wire for line in lines} == {"can", "serial", "icub"}
    assert all(line.decoded > line.limit for line in lines)


def test_frames_are_seen_within_a_scan_and_their_way_and_lost_boards_come_back():
    lines = {line.wire: line for line in latencies(2, 1.0)}
    for line in lines.values():
        assert 0.0 < line.age_p50 <= line.age_p99 < 0.02
        assert 0.0 < line.recovery_p50 <= line.recovery_max < 2.0
    assert lines["can"].age_p99 < 0.0115
    assert lines["can"].stamp_error < 0.001
    assert lines["serial"].age_p50 > 0.0095


def test_an_edge_of_the_switch_is_read_within_two_scans_and_a_lost_board_comes_back():
    emulated_or_skip()
    line = switch_wire.measure(20, 3)
    assert 0.0065 < line.report_p50 <= line.report_max < 0.011
    assert line.report_p50 < line.scan_p50 <= line.scan_p99 < 0.021
    assert 0.02 < line.recovery_p50 <= line.recovery_max < REOPEN_PERIOD + 0.05


def test_insertions_are_compared_seed_by_seed():
    def rows(*endings):
        blank = dict.fromkeys(COLUMNS, None)
        return [
            TrialRow(**blank | {"seed": seed, "outcome": outcome, "total_time": total})
            for seed, (outcome, total) in enumerate(endings)
        ]

    plain = rows(("success", 5.0), ("success", 30.0), ("failure", 9.0), ("success", 6.0))
    line = compared("can", rows(("success", 5.5), ("success", 31.0), ("success", 4.0), ("void", 6.0)), plain)
    assert (line.trials, line.successes, line.same) == (4, 3, 2)
    assert (line.mean_total, line.longer, line.longer_error) == (13.5, 0.75, 0.25)
