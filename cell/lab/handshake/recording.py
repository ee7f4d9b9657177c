"""Recorded conversations with a served cell: all values that a PLC wrote and read, with times."""

import struct
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from cell.config.load import LoadedConfig
from cell.lab.line.cell_process import Scan, cell_process, patient
from cell.lab.line.client import Client, connected
from cell.run.states import State
from drivers.errors import CellError
from plc_bridge.images import CommandImage
from plc_bridge.messages import Result
from plc_bridge.registers import COILS, DISCRETE_INPUTS
from skills.catalogue import CATALOGUE

CYCLE, PATIENCE = 0.02, 60.0
"""Cycle time of the recorded PLC, and longest wait for an answer, s."""
MOTION = CATALOGUE["recover"].code
"""Command code of the motion in the recording; it needs no part."""
UNKNOWN = 77
"""Unknown command code, for a refusal."""


@dataclass(slots=True)
class Conversation:
    """One conversation: the times of change of each signal."""

    title: str
    signals: dict[str, list[tuple[float, int]]] = field(default_factory=dict)
    notes: list[tuple[float, str]] = field(default_factory=list)
    """Events of the conversation with their times, s."""
    end: float = 0.0
    _began: float = field(default_factory=time.perf_counter)

    def take(self, **values: int) -> None:
        """Record signals that were just written or read."""
        now = self.end = time.perf_counter() - self._began
        for name, value in values.items():
            changes = self.signals.setdefault(name, [])
            if not changes or changes[-1][1] != value:
                changes.append((now, value))

    def note(self, text: str) -> None:
        """Record an event."""
        self.notes.append((time.perf_counter() - self._began, text))


def record(loaded: LoadedConfig) -> list[Conversation]:
    """Return both conversations with a cell in a separate process, in real time.

    Raises:
        CellError: The cell gives an unexpected answer.
    """
    scans: list[Scan] = []
    with cell_process(loaded, scans, patient(loaded.cell.plc, 8)) as doors:
        with connected(doors.plain) as client:
            numbers = _by_numbers(client)
        with connected(doors.plain) as client:
            coils = _by_coils(client)
    return [numbers, coils]


class _NumberedPlc:
    """A PLC that writes the whole block in every cycle, and its trace."""

    def __init__(self, client: Client) -> None:
        self.trace = Conversation("By sequence number: one FC16 and one FC4 in every cycle")
        self._client = client
        self.image = CommandImage(sequence=client.report().sequence + 1)

    def until(self, is_met: Callable[[], bool]) -> None:
        """Cycle until a condition holds."""
        deadline = time.monotonic() + PATIENCE
        while not is_met():
            if time.monotonic() > deadline:
                raise CellError(f"{self.trace.title}: the cell does not get on")
            time.sleep(CYCLE)

    def cycle(self, **changes: int) -> dict[str, int]:
        """Write the block and read the report; record both."""
        life = self.image.life % 0xFFFF + 1
        values = {"life": life, "life_tail": life, **changes}
        self.image = CommandImage(
            **{name: values.get(name, getattr(self.image, name)) for name in CommandImage.__slots__}
        )
        self._client.write(self.image)
        report = self._client.report()
        read = {
            "report_answered": report.answered,
            "report_refusal": report.refusal,
            "report_sequence": report.sequence,
            "report_result": report.result,
            "report_state": report.state,
        }
        image = self.image
        self.trace.take(
            command_sequence=image.sequence, command_code=image.code, command_acknowledge=image.acknowledge, **read
        )
        return read


def _by_numbers(client: Client) -> Conversation:
    plc = _NumberedPlc(client)
    plc.trace.note("first number: adopted")
    for _ in range(10):
        plc.cycle()
        time.sleep(CYCLE)
    sequence = (plc.image.sequence + 1) % 0x10000
    plc.trace.note("command")
    plc.cycle(sequence=sequence, code=MOTION)
    plc.until(lambda: plc.cycle()["report_result"] != Result.NONE)
    plc.trace.note("result, held")
    for _ in range(15):
        plc.cycle()
        time.sleep(CYCLE)
    plc.trace.note("acknowledged")
    plc.cycle(acknowledge=sequence)
    plc.until(lambda: plc.cycle()["report_state"] == State.IDLE)
    for _ in range(10):
        plc.cycle()
        time.sleep(CYCLE)
    plc.trace.note("unknown code: refused")
    plc.cycle(sequence=(sequence + 1) % 0x10000, code=UNKNOWN)
    for _ in range(25):
        plc.cycle()
        time.sleep(CYCLE)
    return plc.trace


class _Ladder:
    """A ladder program with coils and discrete inputs, and its trace."""

    def __init__(self, client: Client) -> None:
        self.trace = Conversation("By coils: FC5 and FC2")
        self._client = client
        self._coils = dict.fromkeys(COILS, 0)
        client.ask(struct.pack(">BHH", 6, 2, MOTION))

    def put(self, name: str, value: int) -> None:
        """Write one coil."""
        self._client.ask(struct.pack(">BHH", 5, COILS[name], 0xFF00 if value else 0))
        self._coils[name] = value
        self.read()

    def read(self) -> dict[str, int]:
        """Read and record the discrete inputs."""
        bits = self._client.ask(struct.pack(">BHH", 2, 0, len(DISCRETE_INPUTS)))[2]
        inputs = {name: bits >> place & 1 for name, place in DISCRETE_INPUTS.items()}
        self.trace.take(**self._coils, **inputs)
        return inputs

    def until(self, name: str, value: int = 1) -> None:
        """Read until an input has the wanted value."""
        deadline = time.monotonic() + PATIENCE
        while self.read()[name] != value:
            if time.monotonic() > deadline:
                raise CellError(f"{self.trace.title}: {name} does not become {value}")
            time.sleep(CYCLE)

    def rest(self, cycles: int) -> None:
        """Read this number of times."""
        for _ in range(cycles):
            self.read()
            time.sleep(CYCLE)


def _by_coils(client: Client) -> Conversation:
    ladder = _Ladder(client)
    ladder.trace.note("0 first: an edge must be seen")
    ladder.put("execute", 0)
    ladder.put("reset", 0)
    ladder.until("ready")
    ladder.rest(10)
    ladder.trace.note("execute")
    ladder.put("execute", 1)
    ladder.until("done")
    ladder.rest(15)
    ladder.trace.note("read: execute falls")
    ladder.put("execute", 0)
    ladder.until("ready")
    ladder.rest(10)
    ladder.trace.note("again, then stop")
    ladder.put("execute", 1)
    ladder.rest(20)
    ladder.put("stop", 1)
    ladder.until("command_aborted")
    ladder.rest(15)
    ladder.put("stop", 0)
    ladder.put("execute", 0)
    ladder.trace.note("reset")
    ladder.put("reset", 1)
    ladder.until("ready")
    ladder.put("reset", 0)
    ladder.rest(10)
    return ladder.trace


def transitions(trace: Conversation) -> list[tuple[float, str, int]]:
    """Return every change of a conversation in order: time, s, signal, and new value."""
    changes = [(time_, name, value) for name, each in trace.signals.items() for time_, value in each]
    return sorted(changes, key=lambda change: change[0])
