"""Compiles functions for this computer, once, on two cores; if the scan keeps wall time, all of them before an arm moves."""

import json
import logging
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event

from cell.commands.terminal import complain, progress
from cell.config.cell_config import CellConfig
from cell.config.load import LoadedConfig, load
from cell.devices.assembly import assemble, make_estimator, opened
from cell.records.journal import Journal
from cell.run.line import TerminalLine
from cell.run.supervisor import Supervisor, is_timed
from drivers.compiled import is_kept, is_noted, note
from drivers.errors import CellError
from plc_bridge.protocol.messages import Command, Report, Result
from skills.catalogue import CATALOGUE, INSERT

logger = logging.getLogger(__name__)
_ENGINE = "from sim.world.engine import compile_ahead; compile_ahead()"


def compile_ahead() -> None:
    """Compile the slowest functions of a simulated insertion, once per computer: the engine in a second process, the rest here."""
    if is_kept("sim/world/engine.py"):
        return
    complain("compiling for this computer, once: the first start takes about half a minute longer")
    with progress() as bars, subprocess.Popen([sys.executable, "-c", _ENGINE], stderr=subprocess.DEVNULL) as engine:
        bar, config = bars.add_task("compiling", total=3), load().cell
        assemble(config)  # the assembly compiles the contacts of its peg
        bars.advance(bar)
        make_estimator(config)
        bars.advance(bar)
        engine.wait()  # if it fails, missing functions are compiled at their first call
        bars.advance(bar)


def warm_up(loaded: LoadedConfig) -> CellConfig:
    """Return the cell's config once its functions are compiled.

    If the scan keeps wall time, insert a simulated peg with every recipe whose functions are not compiled yet.

    Compilation during a program would delay its scan by seconds, and the watchdog would halt the arm.
    """
    compile_ahead()
    recipes = loaded.recipes if is_timed(loaded.cell) else {}
    for number, config in recipes.items():
        if is_noted(kind := _kind(config)):
            continue
        logger.info("compiling for recipe %d", number)
        before = logging.root.manager.disable
        logging.disable(logging.CRITICAL)  # the result of the insertion does not matter
        try:
            with suppress(CellError):
                _insert(_simulated(config))
        finally:
            logging.disable(before)
        note(kind)
    return loaded.cell


def _kind(config: CellConfig) -> str:
    """Return the values that determine the functions that an insertion calls, and their types."""
    sections = {name: getattr(config, name).model_dump(mode="json") for name in ("peg", "hole", "smoothing")}
    return json.dumps([sections, config.params(INSERT).estimator, config.skin.layout], sort_keys=True, default=str)


def _simulated(config: CellConfig) -> CellConfig:
    """Return the same part and methods in the shipped simulated cell, at the fastest pace."""
    shipped = load(sets=["sim.pace=max"]).cell
    world = {name: getattr(shipped, name) for name in ("arm", "gripper", "switch", "boards", "calibration", "sim")}
    world |= {name: getattr(config, name) or getattr(shipped, name) for name in ("contact", "grip")}
    world["skin"] = shipped.skin.model_copy(update={"layout": config.skin.layout})
    return config.model_copy(update=world)


def _insert(config: CellConfig) -> None:
    """Run one insertion.

    Raises:
        CellError: The cell cannot be assembled, or its physics diverge.
    """
    ended = Event()

    def watch(report: Report) -> None:
        if report.result is not Result.NONE:
            ended.set()

    with TemporaryDirectory() as folder, Journal(Path(folder)) as journal, opened(assemble(config)) as cell:
        line = TerminalLine(Command(1, CATALOGUE["insert_peg"].code, source="warm-up"), watch)
        Supervisor(cell, LoadedConfig({0: config}), line, journal, ended).serve()
