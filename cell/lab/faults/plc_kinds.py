"""Faults of PLCs and of their network, through the real server."""

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial

from cell.lab.faults.bench import LIFE_TIMEOUT, FaultBench
from cell.lab.faults.cases import INSERT
from cell.lab.faults.contract import FaultKind, Undo, changed
from drivers.errors import CellError
from plc_bridge.peer import CellSilentError, Peer
from plc_bridge.protocol.messages import Control

LASTING = 0.5
"""Duration of torn blocks and foreign connections, s of wall time."""
SILENT = "its life counter stands still for plc.life_timeout before anybody can know"


def _lost(act: Callable[[FaultBench], None], bench: FaultBench) -> None:
    bench.plc_act = lambda: act(bench)
    # Simulated time runs faster than the wall clock of the silence, so it stands still until the timeout.
    time.sleep(LIFE_TIMEOUT)


def _killed(bench: FaultBench) -> None:
    bench.is_plc_lost = True
    bench.peer.close()
    raise CellSilentError("the PLC was switched off")


def _frozen(bench: FaultBench) -> None:
    bench.is_plc_lost = True
    raise CellSilentError("the PLC's program stands still")  # and its connection stays open until it returns


def _torn(bench: FaultBench) -> Undo:
    return changed(bench.peer, "torn_until", time.monotonic() + LASTING)


def _second(bench: FaultBench) -> Undo:
    thread = threading.Thread(target=_command, args=(bench,), daemon=True)
    thread.start()
    return thread.join


def _command(bench: FaultBench) -> None:
    """Let another PLC request the lease, and every command that only the holder may request."""
    peer, until = Peer(*bench.bridge.address), time.monotonic() + LASTING
    with suppress(CellError):
        peer.connect()
        peer.take()
        while time.monotonic() < until:
            for code in (INSERT, Control.HOLD, Control.RESET, Control.CLEARED):
                peer.trigger(code)
    peer.close()


PLC_KINDS: tuple[FaultKind, ...] = (
    FaultKind("plc: killed", partial(_lost, _killed), silences_plc=True, slow=SILENT),
    FaultKind("plc: frozen", partial(_lost, _frozen), silences_plc=True, slow=SILENT),
    FaultKind("plc: blocks torn", _torn, is_harmless=True),
    FaultKind("plc: two at once", _second, is_harmless=True),
)
"""All kinds of PLC faults."""
