from dataclasses import replace

import pytest

from cell.lab.faults.kills import Kill

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
    [SOUND, replace(SOUND, told=0, outcome="", samples=0, told_scans=0), replace(SOUND, signal="SIGTERM", status=0)],
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
    ],
)
def test_what_is_lost_untrue_or_rude_is_not(change):
    assert not replace(SOUND, **change).is_sound
