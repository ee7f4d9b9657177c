from dataclasses import replace

import pytest

from cell.lab.faults.disks import FullDisk
from cell.lab.faults.kills import Kill, begun, draw
from cell.lab.rows import kept_rows, write_rows

SOUND = Kill(
    "SIGKILL",
    40,
    -9,
    told=3,
    outcome="lost",
    samples=100,
    told_scans=100,
    still_running=0,
    twice=0,
    part="in_hand",
    part_next="unknown",
)


@pytest.mark.parametrize(
    "kill",
    [
        SOUND,
        replace(SOUND, told=0, outcome="", samples=0, told_scans=0),
        replace(SOUND, signal="SIGTERM", status=0),
        replace(SOUND, resets=1, aborted=1001),
    ],
)
def test_an_end_that_lost_nothing_is_sound(kill):
    assert kill.is_sound


@pytest.mark.parametrize(
    "change",
    [
        {"part_next": "rack"},
        {"part": "on_plate"},
        {"outcome": ""},
        {"outcome": "running"},
        {"still_running": 1},
        {"twice": 1},
        {"status": 0},
        {"samples": 99},
        {"signal": "SIGTERM"},
        {"trouble": "the cell stands aborted with fault 1001 after 5 resets"},
    ],
)
def test_what_is_lost_untrue_or_rude_is_not(change):
    assert not replace(SOUND, **change).is_sound


def test_a_campaign_goes_on_behind_the_ends_that_were_seen_whole_and_fit(tmp_path):
    drawn = draw(3, 7)
    seen = [replace(SOUND, signal=how.name, progress=at) for how, at in drawn]
    write_rows(seen, tmp_path / "kills.csv")
    assert begun(kept_rows(Kill, tmp_path / "kills.csv"), drawn) == seen
    assert begun([*seen[:2], replace(seen[2], part_next="")], drawn) == seen[:2]
    assert begun(seen, draw(3, 8)) == []


def test_a_table_of_full_disks_is_read_as_it_was_written(tmp_path):
    case = FullDisk("killed", 40, 3, "success", False, "lost", 100, 90, 0, 0, -1)
    write_rows([case], tmp_path / "disks.csv")
    assert kept_rows(FullDisk, tmp_path / "disks.csv") == [case]
    assert kept_rows(FullDisk, tmp_path / "none.csv") == []
