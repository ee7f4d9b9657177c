"""The timing diagrams of the guide for PLC programmers: both ways to command the cell over Modbus TCP, recorded and drawn.

python -m tests.handshake docs/pictures
"""

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from pymodbus.client import ModbusTcpClient

from cell.lab.faults.program import served
from cell.run.states import State
from plc_bridge.protocol.images import COMMAND, REPORT, CommandImage, command_words
from plc_bridge.protocol.messages import Refusal, Result
from plc_bridge.protocol.registers import COILS, DISCRETE_INPUTS
from skills.catalogue import CATALOGUE

CYCLE, PATIENCE = 0.02, 60.0
"""Cycle time of the recorded PLC, and longest wait for an answer, s."""
MOTION, UNKNOWN = CATALOGUE["recover"].code, 77
"""Command code of a motion that needs no part, and one that does not exist."""
WRITTEN, READ = "#0b5394", "#38761d"
WORDS = {"report_result": Result, "report_state": State, "report_refusal": Refusal}
BITS = ("execute", "stop", "reset", "busy", "done", "error", "command_aborted", "ready")
PLC = ("command_", "execute", "stop", "reset")


@dataclass
class Conversation:
    """One conversation: the times of change of each signal, and its events, s."""

    title: str
    signals: dict[str, list[tuple[float, int]]] = field(default_factory=dict)
    notes: list[tuple[float, str]] = field(default_factory=list)
    end: float = 0.0
    began: float = field(default_factory=time.perf_counter)

    def take(self, **values: int) -> None:
        """Record signals that were just written or read."""
        now = self.end = time.perf_counter() - self.began
        for name, value in values.items():
            changes = self.signals.setdefault(name, [])
            if not changes or changes[-1][1] != value:
                changes.append((now, value))

    def note(self, text: str) -> None:
        self.notes.append((time.perf_counter() - self.began, text))

    def until(self, is_met: Callable[[], bool]) -> None:
        """Cycle until a condition holds."""
        deadline = time.monotonic() + PATIENCE
        while not is_met():
            assert time.monotonic() < deadline, f"{self.title}: the cell does not get on"
            time.sleep(CYCLE)

    def rest(self, cycle: Callable[[], object], cycles: int) -> None:
        for _ in range(cycles):
            cycle()
            time.sleep(CYCLE)


def by_numbers(client: ModbusTcpClient) -> Conversation:
    """Record a PLC that writes the whole block in every cycle."""
    trace = Conversation("By sequence number: one FC16 and one FC4 in every cycle")
    read = lambda: REPORT.read(client.read_input_registers(REPORT.start, count=REPORT.words).registers)  # noqa: E731
    image = CommandImage(sequence=read().sequence + 1)

    def cycle(**changes: int) -> dict[str, int]:
        nonlocal image
        life = image.life % 0xFFFF + 1
        image = replace(image, life=life, life_tail=life, **changes)
        client.write_registers(COMMAND.start, command_words(image))
        report = read()
        seen = {name: getattr(report, name) for name in ("answered", "refusal", "sequence", "result", "state")}
        asked = {name: getattr(image, name) for name in ("sequence", "code", "acknowledge")}
        trace.take(**{f"command_{name}": value for name, value in asked.items()})
        trace.take(**{f"report_{name}": value for name, value in seen.items()})
        return seen

    trace.note("first number: adopted")
    trace.rest(cycle, 10)
    sequence = (image.sequence + 1) % 0x10000
    trace.note("command")
    cycle(sequence=sequence, code=MOTION)
    trace.until(lambda: cycle()["result"] != Result.NONE)
    trace.note("result, held")
    trace.rest(cycle, 15)
    trace.note("acknowledged")
    cycle(acknowledge=sequence)
    trace.until(lambda: cycle()["state"] == State.IDLE)
    trace.rest(cycle, 10)
    trace.note("unknown code: refused")
    cycle(sequence=(sequence + 1) % 0x10000, code=UNKNOWN)
    trace.rest(cycle, 25)
    return trace


def by_coils(client: ModbusTcpClient) -> Conversation:
    """Record a ladder program with coils and discrete inputs."""
    trace, coils = Conversation("By coils: FC5 and FC2"), dict.fromkeys(COILS, 0)
    client.write_register(2, MOTION)

    def read() -> dict[str, int]:
        bits = client.read_discrete_inputs(0, count=len(DISCRETE_INPUTS)).bits
        inputs = {name: int(bits[place]) for name, place in DISCRETE_INPUTS.items()}
        trace.take(**coils, **inputs)
        return inputs

    steps: tuple[tuple[str, str, int, str, int], ...] = (
        ("0 first: an edge must be seen", "execute", 0, "", 0),
        ("", "reset", 0, "ready", 10),
        ("execute", "execute", 1, "done", 15),
        ("read: execute falls", "execute", 0, "ready", 10),
        ("again, then stop", "execute", 1, "", 20),
        ("", "stop", 1, "command_aborted", 15),
        ("", "stop", 0, "", 0),
        ("", "execute", 0, "", 0),
        ("reset", "reset", 1, "ready", 0),
        ("", "reset", 0, "", 10),
    )
    for note, coil, value, awaited, cycles in steps:
        if note:
            trace.note(note)
        client.write_coil(COILS[coil], bool(value))
        coils[coil] = value
        read()
        if awaited:
            trace.until(lambda awaited=awaited: read()[awaited] == 1)
        trace.rest(read, cycles)
    return trace


def draw(trace: Conversation, path: Path) -> None:
    """Draw one conversation: a row for each signal, bits as levels, numbers as labelled intervals."""
    names = list(trace.signals)
    figure = Figure(figsize=(11, 0.46 * len(names) + 1.5), layout="constrained")
    axes = figure.add_subplot()
    colours = [WRITTEN if name.startswith(PLC) and name != "command_aborted" else READ for name in names]
    for row, (name, colour) in enumerate(zip(reversed(names), reversed(colours), strict=True)):
        draw_signal(axes, row, trace, name, colour)
    for moment, text in trace.notes:
        axes.axvline(moment, color="#999999", linewidth=0.7, linestyle=":")
        axes.text(moment, len(names) - 0.1, f" {text}", fontsize=7.5, rotation=18, va="bottom")
    axes.set_yticks([row + 0.3 for row in range(len(names))], list(reversed(names)), fontsize=9)
    for label, colour in zip(axes.get_yticklabels(), reversed(colours), strict=True):
        label.set_color(colour)
    axes.set_ylim(-0.2, len(names) + 0.9)
    axes.set_xlim(0.0, trace.end)
    axes.set_xlabel("time on the wire (s); blue is written by the PLC, green is read from the cell")
    axes.set_title(trace.title, fontsize=10)
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(axis="y", length=0)
    figure.savefig(path, dpi=110)


def draw_signal(axes: Axes, row: int, trace: Conversation, name: str, colour: str) -> None:
    times, values = zip(*trace.signals[name], strict=True)
    if name in BITS:
        levels = [row + 0.6 * value for value in (*values, values[-1])]
        axes.step([*times, trace.end], levels, where="post", color=colour, linewidth=1.6)
        return
    for start, end, value in zip(times, [*times[1:], trace.end], values, strict=True):
        axes.fill_between([start, end], row, row + 0.6, facecolor=colour, alpha=0.12, edgecolor=colour, linewidth=0.8)
        word = WORDS[name](value).name if name in WORDS else str(value)
        if end - start > 0.009 * trace.end * len(word):
            axes.text((start + end) / 2, row + 0.3, word, ha="center", va="center", fontsize=8, color=colour)


def main(folder: Path) -> None:
    """Hold both conversations with a cell in real time, and draw them into a folder."""
    with TemporaryDirectory() as name, served(Path(name) / "journal", []) as program:
        for converse, picture in ((by_numbers, "handshake.png"), (by_coils, "coils.png")):
            host, port = program.address
            with ModbusTcpClient(host, port=port) as client:
                draw(converse(client), folder / picture)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
