"""Timing diagrams of recorded conversations."""

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cell.lab.handshake.recording import Conversation
from cell.run.states import State
from plc_bridge.messages import Refusal, Result

WRITTEN, READ = "#0b5394", "#38761d"
_WORDS = {"report_result": Result, "report_state": State, "report_refusal": Refusal}
_BITS = ("execute", "stop", "reset", "busy", "done", "error", "command_aborted", "ready")
_PLC = ("command_", "execute", "stop", "reset")


def draw(trace: Conversation, path: Path) -> None:
    """Draw one conversation: a row for each signal, bits as levels, numbers as labelled intervals."""
    names = list(trace.signals)
    figure = Figure(figsize=(11, 0.46 * len(names) + 1.5), layout="constrained")
    axes = figure.add_subplot()
    for row, name in enumerate(reversed(names)):
        is_written = name.startswith(_PLC) and name != "command_aborted"
        colour = WRITTEN if is_written else READ
        (_draw_bit if name in _BITS else _draw_number)(axes, row, trace, name, colour)
    for moment, text in trace.notes:
        axes.axvline(moment, color="#999999", linewidth=0.7, linestyle=":")
        axes.text(moment, len(names) - 0.1, f" {text}", fontsize=7.5, rotation=18, va="bottom")
    axes.set_yticks([row + 0.3 for row in range(len(names))], list(reversed(names)), fontsize=9)
    for label in axes.get_yticklabels():
        text = label.get_text()
        label.set_color(WRITTEN if text.startswith(_PLC) and text != "command_aborted" else READ)
    axes.set_ylim(-0.2, len(names) + 0.9)
    axes.set_xlim(0.0, trace.end)
    axes.set_xlabel("time on the wire (s); blue is written by the PLC, green is read from the cell")
    axes.set_title(trace.title, fontsize=10)
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    axes.tick_params(axis="y", length=0)
    figure.savefig(path, dpi=110)


def _stretches(trace: Conversation, name: str) -> list[tuple[float, float, int]]:
    """Return start, end and value of each interval of a signal."""
    changes = trace.signals[name]
    ends = [moment for moment, _ in changes[1:]] + [trace.end]
    return [(start, end, value) for (start, value), end in zip(changes, ends, strict=True)]


def _draw_bit(axes: Axes, row: int, trace: Conversation, name: str, colour: str) -> None:
    times, levels = [], []
    for start, end, value in _stretches(trace, name):
        times += [start, end]
        levels += [row + 0.6 * value, row + 0.6 * value]
    axes.plot(times, levels, color=colour, linewidth=1.6)


def _draw_number(axes: Axes, row: int, trace: Conversation, name: str, colour: str) -> None:
    for start, end, value in _stretches(trace, name):
        axes.fill_between([start, end], row, row + 0.6, facecolor=colour, alpha=0.12, edgecolor=colour, linewidth=0.8)
        word = _WORDS[name](value).name if name in _WORDS else str(value)
        if end - start > 0.009 * trace.end * len(word):
            axes.text((start + end) / 2, row + 0.3, word, ha="center", va="center", fontsize=8, color=colour)
