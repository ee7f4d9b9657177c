"""A terminal as a Modbus client of a served cell: run, stop and watch."""

from collections.abc import Callable, Iterable
from threading import Event as ThreadEvent

from cell.config.layers import parse_set
from cell.config.parameters import PARAMETERS
from cell.run.line import CONTROLS
from drivers.errors import CellError, ConfigError
from plc_bridge.peer import Peer
from plc_bridge.protocol.messages import Diagnostics, Report
from skills.catalogue import CATALOGUE


def raw_parameters(sets: Iterable[str]) -> list[tuple[int, int]]:
    """Return number and raw count of each `KEY=VALUE`.

    Raises:
        ConfigError: The key is not a parameter of commands, or the value is out of range.
    """
    numbers = {spec.name: number for number, spec in enumerate(PARAMETERS)}
    found = []
    for text in sets:
        place, value = parse_set(text)
        key = ".".join(place)
        if key not in numbers:
            raise ConfigError(f"--set {key}: not for --connect; {', '.join(numbers)} allowed")
        spec = PARAMETERS[numbers[key]]
        if isinstance(value, bool) or not isinstance(value, int | float) or not spec.low <= value <= spec.high:
            raise ConfigError(
                f"--set {key} = {value!r}: a number from {spec.low:g} to {spec.high:g} {spec.unit} allowed"
            )
        found.append((numbers[key], round(value / spec.scale)))
    return found


def run_remote(
    address: tuple[str, int],
    name: str,
    recipe: int,
    serial: str,
    parameters: list[tuple[int, int]],
    watch: Callable[[Report], None],
    stop: ThreadEvent,
) -> Report:
    """Run a program, a skill or a control on a served cell, under the same lease as a PLC; return the last report.

    Raises:
        CellError: The cell times out, or another client holds the lease.
    """
    longest = 3600.0  # Longest wait for the end of a run, wall time, s.
    peer = Peer(*address)
    peer.connect()
    is_stopping = False

    def look(report: Report) -> None:
        nonlocal is_stopping
        watch(report)
        if stop.is_set() and not is_stopping:
            is_stopping = True
            peer.stop()

    try:
        if name in ("stop", "abort"):
            return peer.run(CONTROLS[name], timeout=longest)
        if not peer.take():
            raise CellError(
                f"{address[0]}:{address[1]}: {peer.read_report().holder} holds the lease; only its holder may start"
            )
        code = CONTROLS[name] if name in CONTROLS else CATALOGUE[name].code
        report = peer.run(code, recipe, serial, parameters, timeout=longest, watch=look)
        peer.release()
        return report
    finally:
        peer.close()


def watch_remote(
    address: tuple[str, int], show: Callable[[Report, Diagnostics], None], stop: ThreadEvent, once: bool
) -> None:
    """Poll a served cell's report and counts without writing.

    Raises:
        CellError: The cell times out.
    """
    peer = Peer(*address)
    try:
        peer.look()
        while True:
            show(peer.read_report(), peer.read_diagnostics())
            # Polling period of `watch`, s.
            if once or stop.wait(0.1):
                return
    finally:
        peer.close()
