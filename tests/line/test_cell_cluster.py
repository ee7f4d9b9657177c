"""Trials on worker processes and on a Dask scheduler: the same rows if any of them is killed or interrupted."""

import json
import logging
import multiprocessing
import os
import select
import signal
import socket
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import replace
from functools import partial

import pytest
from distributed import LocalCluster

from cell.commands.cli import FAULT, main
from cell.config.load import load
from cell.lab import workers
from cell.lab.trials import PARTIAL, run_trial, run_trials
from cell.lab.workers import Pool, _deaf_children, on_cluster, on_processes
from cell.records.provenance import versions
from drivers.errors import CellError

SHORT = ["search.timeout=0.1"]
SEEDS = range(5, 8)
LOCAL = ("--host", "127.0.0.1", "--dashboard-address", "127.0.0.1:0")
KILLED = """
from cell.config.load import load
from cell.lab.trials import run_trials
run_trials(load(sets={sets}).cell, range(5, 100), 1, __import__("pathlib").Path({folder!r}), lambda row: print(row.seed, flush=True))
"""


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def running(*arguments):
    """Yield a Python process; it is killed at the end."""
    process = subprocess.Popen(
        [sys.executable, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), workers.BLAS: "1"},
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def worker(address: str):
    """Return a worker of one thread, without the nanny that would start it again."""
    return running("-m", "distributed.cli.dask_worker", address, *LOCAL, "--nthreads", "1", "--no-nanny")


@pytest.fixture(scope="module")
def config():
    return load(sets=SHORT).cell


@pytest.fixture(scope="module")
def by_pool(config, tmp_path_factory):
    """Return the rows of another process."""
    return timeless(run_trials(config, SEEDS, 1, tmp_path_factory.mktemp("pool"), lambda row: None))


def timeless(rows):
    """Return rows without their wall times."""
    return [replace(row, wall_time=0.0) for row in rows]


STUCK = partial(signal.sigtimedwait, {signal.SIGUSR1})
"""A task that waits for its seed's seconds."""


def test_a_killed_call_loses_no_finished_trial_and_leaves_no_process(config, tmp_path):
    """The repeated call keeps finished trials as they are."""
    with running("-c", KILLED.format(sets=SHORT, folder=str(tmp_path))) as call:
        finished = [int(call.stdout.readline()) for _ in range(2)]
        call.kill()
        # The worker holds the same pipe: its end is the worker's.
        while select.select([call.stdout], [], [], 30.0)[0] and call.stdout.readline():
            pass
        assert select.select([call.stdout], [], [], 0.0)[0]
    kept = [json.loads(line) for line in (tmp_path / PARTIAL).read_text().splitlines()[1:]]
    rows = run_trials(config, sorted({*finished, 5}), 1, tmp_path, lambda row: None)
    assert set(finished) <= {row["seed"] for row in kept}
    assert {row["wall_time"] for row in kept if row["seed"] in finished} <= {row.wall_time for row in rows}


def test_a_cluster_gives_the_same_rows_also_if_a_worker_dies(config, by_pool, tmp_path):
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    start = ("-m", "distributed.cli.dask_scheduler", *LOCAL, "--port", str(port))
    with running(*start) as scheduler, worker(address) as first:
        assert timeless(run_trials(config, SEEDS, 1, tmp_path, lambda row: None, address)) == by_pool
        rows = on_cluster(STUCK, [0, 1, 1], address)
        next(rows)
        first.kill()
        with worker(address):
            assert list(rows) == [None, None]
            rows = on_cluster(STUCK, [0, 100_000], address, patience=10.0)
            next(rows)
            scheduler.kill()
            with pytest.raises(CellError, match="lost; repeat the command to continue"):
                list(rows)


def test_a_cluster_without_workers_or_with_other_versions_is_refused(monkeypatch):
    """Scheduler and worker are threads of this process, which looks its versions up first and the worker then."""
    found = iter([{"code": "another"}, versions()])
    with LocalCluster(n_workers=0, processes=False, dashboard_address=None) as cluster:

        def refused(said, patience=30.0):
            with pytest.raises(CellError, match=said):
                list(on_cluster(STUCK, [0], cluster.scheduler_address, patience=patience))

        refused(r"no worker for 0\.1 s; .*dask worker inproc://", patience=0.1)
        cluster.scale(1)
        monkeypatch.setenv(workers.BLAS, "2")
        refused(f"{workers.BLAS} = 2; 1 allowed")
        monkeypatch.setattr(workers, "versions", lambda: next(found))
        refused(r"code .*; another, as on the computer that requested the trials, allowed")


def test_an_address_without_a_scheduler_is_reported_in_one_line(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr(workers, "CONNECT", 0.2)
    address = f"tcp://127.0.0.1:{free_port()}"
    assert main(["trials", "--trials", "1", "--scheduler", address, "--out", str(tmp_path)]) == FAULT
    logging.getLogger().handlers.clear()
    printed = capsys.readouterr()
    assert (printed.out, printed.err.count("\n")) == ("", 1)
    assert f"scheduler {address}: no answer" in printed.err


def test_rows_do_not_depend_on_the_process_but_on_the_seed(config, by_pool):
    assert timeless(run_trial(config, seed) for seed in SEEDS) == by_pool
    assert len({(row.hole_x, row.hole_y) for row in by_pool}) == len(SEEDS)
    assert len({(row.start_x, row.start_y) for row in by_pool}) == len(SEEDS)


def test_an_interruption_does_not_wait_for_trials_under_way():
    rows = on_processes(STUCK, [0, 100_000, 100_001], 2)
    assert next(rows) is None
    rows.close()  # as an interruption does; the trials would last for a day
    with Pool(1) as pool:
        pool.submit(STUCK, 100_000)


def test_processes_of_a_call_that_had_enough_serve_the_next():
    served = []
    for _ in range(2):
        rows = []
        rows += on_processes(STUCK, [0] * 100, 1, lambda rows=rows: len(rows) >= 2)
        served.append({process.pid for process in multiprocessing.active_children()})
        assert len(rows) == 2
    assert served[0] == served[1] != set()


def test_workers_leave_a_ctrl_c_to_their_parent():
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    with _deaf_children():
        assert signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ())
    assert signal.pthread_sigmask(signal.SIG_BLOCK, ()) == before
