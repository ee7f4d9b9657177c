"""A Ctrl-C ends trials at once, whatever their workers are at."""

import signal
from functools import partial

from cell.lab.workers import Pool, _deaf_children, on_processes

STUCK = partial(signal.sigtimedwait, {signal.SIGUSR1})
"""A task that waits for its seed's seconds."""


def test_whoever_interrupts_does_not_wait_for_trials_under_way():
    rows = on_processes(STUCK, [0, 100_000, 100_001], 2)
    assert next(rows) is None
    rows.close()  # as an interruption does; it would wait for a day


def test_a_pool_that_is_left_waits_for_none_of_its_tasks():
    with Pool(1) as pool:
        pool.submit(STUCK, 100_000)


def test_workers_leave_a_ctrl_c_to_their_parent():
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    with _deaf_children():
        assert signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ())
    assert signal.pthread_sigmask(signal.SIG_BLOCK, ()) == before
