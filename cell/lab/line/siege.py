"""Effect of attacks on a PLC with a cycle of 20 ms: continuation of its run, and duration of its cycles."""

import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cell.config.load import LoadedConfig
from cell.lab.line.attacks import ATTACKS, attack
from cell.lab.line.cell_process import Doors, Scan, cell_process
from cell.lab.line.client import connected
from cell.lab.line.measure import Measure
from cell.lab.line.plc import CYCLE, Plc
from cell.run.states import State
from drivers.errors import ConfigError
from drivers.quantities import Vector
from plc_bridge.config import ModbusConfig, PlcConfig, TlsConfig
from plc_bridge.messages import Result
from skills.catalogue import CATALOGUE

BURST = 0.5
"""Length of one attempt under attack, s."""
LONGEST_CYCLE = 0.05
"""Largest permitted p99 of the cycles, s."""
_INSERT = CATALOGUE["insert_peg"].code


@dataclass(frozen=True, slots=True, eq=False)
class Siege:
    """One attack."""

    name: str
    tries: int
    kept: int
    """Number of attempts in which the PLC's connection and its run continued."""
    cycles: Vector
    """Duration of each exchange of both blocks under attack, s."""


def besiege(loaded: LoadedConfig, tries: int, done: Callable[[], None] = lambda: None) -> list[Siege]:
    """Attack a served cell in every way, repeatedly, while a PLC runs insertions; `done` is called after each attempt.

    Raises:
        ConfigError: The program openssl is missing; it creates the certificate of the TLS server.
        CellError: The cell's process does not answer.
    """
    scans: list[Scan] = []
    with tempfile.TemporaryDirectory() as folder:
        plc = PlcConfig(modbus=ModbusConfig(port=0), tls=_tls(Path(folder)))
        with cell_process(loaded, scans, plc) as doors:
            return [_besiege(name, doors, tries, done) for name in ATTACKS]


def _besiege(name: str, doors: Doors, tries: int, done: Callable[[], None]) -> Siege:
    kept, cycles = 0, list[float]()
    plc: Plc | None = None
    n = 0
    while n < tries:
        with connected(doors.plain) as client:
            plc = Plc(client)
            plc.make_ready()
            try:
                while n < tries:
                    n += 1
                    plc.ensure_running(_INSERT)
                    with attack(name, doors, BURST):
                        kept += _hold_out(plc, cycles)
                    done()
                plc.finish()
            except OSError:
                continue  # the connection was lost: this attempt fails, and the next begins with a new connection
    return Siege(name, tries, kept, np.array(cycles))


def _hold_out(plc: Plc, cycles: list[float]) -> bool:
    """Cycle as a PLC for the duration of the attack; return True if the run continues or has ended by itself."""
    end = time.perf_counter() + BURST
    is_kept = True
    while (started := time.perf_counter()) < end:
        report = plc.cycle()
        cycles.append(time.perf_counter() - started)
        is_kept &= report.state not in (State.STOPPED, State.ABORTED) and report.result != Result.FAULT
        time.sleep(max(CYCLE - (time.perf_counter() - started), 0.0))
    return is_kept


def measures(sieges: list[Siege]) -> list[Measure]:
    """Return the results of the attacks; the first line is the PLC without an attack."""
    quiet = _p99(sieges[0])
    lines = []
    for siege in sieges:
        p99, beside = _p99(siege), None if siege is sieges[0] else quiet
        every, is_kept = f"{siege.tries} of {siege.tries}", siege.kept == siege.tries
        lines.append(Measure(f"{siege.name}: runs kept", siege.kept, target=every, holds=is_kept))
        name, target = f"{siege.name}: cycle p99, n = {len(siege.cycles)}", f"< {LONGEST_CYCLE:g}"
        lines.append(Measure(name, p99, beside, "s", target, p99 < LONGEST_CYCLE))
    return lines


def _p99(siege: Siege) -> float:
    return float(np.percentile(siege.cycles, 99)) if len(siege.cycles) else float("inf")


def _tls(folder: Path) -> TlsConfig:
    """Return a TLS server with a self-signed certificate."""
    openssl = shutil.which("openssl")
    if openssl is None:
        raise ConfigError("openssl is not installed: the TLS server under attack needs a certificate from it")
    certificate, key = folder / "cell.pem", folder / "cell.key"
    new = ["req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "1"]
    files = ["-subj", "/CN=cell", "-keyout", str(key), "-out", str(certificate)]
    subprocess.run([openssl, *new, *files], check=True, capture_output=True)
    return TlsConfig(port=0, certificate=certificate, key=key, authority=certificate)
