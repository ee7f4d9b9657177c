"""Age of a frame when a scan first reads it, and recovery of an unplugged board, on every wire of the skin."""

from collections.abc import Callable

import numpy as np
import pytest

from cell.config.load import load
from cell.devices.assembly import bench_skin
from drivers.errors import SkinSilentError
from sim.config import WireFaults

SCAN, AWAY = 0.01, 1.0
"""Period of the scans, and time without the plug, s."""


def measured(board, now: Callable[[], float]) -> list[float]:
    """Return a list to which the time of every measurement of the board is appended."""
    born: list[float] = []
    source = getattr(board, "hub", board)
    measure = source.measure

    def watched():
        born.append(now())
        return measure()

    source.measure = watched
    return born


@pytest.mark.parametrize(
    ("keys", "least", "most"),
    [
        (("skin.kind=can",), 0.0, 0.0115),
        (("skin.kind=serial",), 0.0095, 0.02),
        (("skin.kind=can", "skin.rate=25", 'skin.board={kind="icub"}'), 0.0, 0.02),
    ],
    ids=["can", "serial", "icub"],
)
def test_a_frame_is_read_within_two_scans_and_a_lost_board_recovers(keys, least, most):
    skin, clock, _ = bench_skin(load(sets=keys).cell, 0.05)
    (link,) = clock.boards
    born = measured(link.board, clock.now)
    clock.wait_until(0.4)
    skin.open()
    ages, shown, end = [], skin.read().sequence, clock.now() + 1.0
    while clock.now() < end:
        clock.wait_until(clock.now() + SCAN)
        frame = skin.read()
        if frame.sequence != shown:
            shown = frame.sequence
            ages.append(clock.now() - born[skin.figures().scans - 1])
            assert abs(frame.stamp - born[skin.figures().scans - 1]) < 0.01
    assert least < np.median(ages)
    assert max(ages) < most

    plugged = clock.now() + AWAY
    link.faults = WireFaults(unplugged=((clock.now(), plugged),))
    stamp = 0.0
    while stamp <= plugged:
        clock.wait_until(clock.now() + SCAN)
        try:
            stamp = skin.read().stamp
        except SkinSilentError:
            continue
    assert clock.now() - plugged < 2.0
    skin.close()
