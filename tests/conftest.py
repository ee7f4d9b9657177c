"""Options and fixtures shared by all tests."""

import fcntl
import gc
import logging
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from cell.config.load import LoadedConfig, load
from skills.contract import Observation
from tests.fakes import Rig
from tests.inputs import inputs

LEVEL = logging.getLogger().level

# Properties are tried with the same inputs each time, however long one takes on a busy computer.
settings.register_profile("same", derandomize=True, deadline=None, max_examples=inputs(80), database=None)
settings.load_profile("same")

# Processes that tests start keep their bytecode, as an installed program does, whatever the environment says.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let the contracts be checked on real devices."""
    parser.addoption(
        "--hardware", type=Path, metavar="FILE", help="config of a real cell: tests/contract runs on it too"
    )


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Run at least three workers: while a test waits for another process, its core would idle."""
    return max(len(os.sched_getaffinity(0)), 3)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Look for no garbage while tests are collected, an eighth of the time, nor later among them: they stay."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> Iterator[None]:
    """Let a test that keeps time with other processes have the machine for itself, whichever worker it runs on."""
    is_alone = item.get_closest_marker("alone") is not None
    with Path(__file__).open() as turn:
        fcntl.flock(turn, fcntl.LOCK_EX if is_alone else fcntl.LOCK_SH)
        return (yield)


@pytest.fixture(scope="session")
def loaded() -> LoadedConfig:
    """Return the cell that ships with the program, without errors; a test of an error adds it."""
    return load(sets=["reality.scale=0.0"])


@pytest.fixture(autouse=True)
def _level_of_the_log() -> Iterator[None]:
    """Set the level back that a command may have changed, in a test or in what several share: others read the log."""
    logging.getLogger().setLevel(LEVEL)
    yield
    logging.getLogger().setLevel(LEVEL)


@pytest.fixture
def rig(loaded: LoadedConfig, tmp_path: Path) -> Rig:
    """Return a cell of fakes with a PLC."""
    return Rig(loaded, tmp_path / "journal")


@pytest.fixture
def seen(rig: Rig) -> Observation:
    """Return the observation of one scan of a cell of fakes."""
    return rig.cell.context(0).observe()


@pytest.fixture(autouse=True)
def closed_rigs() -> Iterator[None]:
    """Close the journals of all cells of fakes that a test has made, whose files and threads would outlive it."""
    yield
    while Rig.made:
        Rig.made.pop().journal.close()
