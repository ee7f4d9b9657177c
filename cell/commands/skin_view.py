"""Display of both fingers of the skin in a terminal, live or from a recording, and their frames as data."""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
from rich.console import Group
from rich.table import Table
from rich.text import Text

from cell.config.cell_config import CellConfig
from cell.devices.assembly import SkinLine, assemble, opened, played_skin
from cell.records.schema import finite
from drivers.errors import CellError, ConfigError
from drivers.quantities import FINGER_NAMES, FINGERS, Mask, TaxelFrame, Vector
from drivers.scene_facts import BRIGHT, NOISE, felt, touch_colours
from drivers.skin.figures import SkinFigures
from drivers.skin.layout import Layout, finger_positions
from drivers.transport.traffic import TrafficEndedError


@dataclass(frozen=True, slots=True, eq=False)
class SeenFrame:
    """One frame, and the reception figures of the skin if available."""

    frame: TaxelFrame
    figures: SkinFigures | None


Show = Callable[[SeenFrame], None]


def watch(config: CellConfig, seconds: float, show: Show, stop: Event) -> None:
    """Show every new frame of the live skin.

    Args:
        config: Config of the cell; its other devices stay closed.
        seconds: Duration on the cell's clock, s.
        show: Function called with every new frame, at least once.
        stop: Event that ends the display earlier.

    Raises:
        CellError: A device cannot be opened, or the skin has timed out.
    """
    with opened(assemble(config), "skin") as cell:
        felt, period = SkinLine(cell.skin, cell.clock, cell.skin_figures), 1.0 / config.scan_rate
        end, shown = felt.clock.now() + seconds, -1
        while True:
            shown = _show_new(felt, shown, show)
            if stop.is_set() or felt.clock.now() >= end:
                return
            felt.clock.wait_until(felt.clock.now() + period)


def play(config: CellConfig, path: Path, seconds: float, show: Show, stop: Event, at_pace: bool) -> None:
    """Show a recording of traffic or text.

    Args:
        config: Config with the board of the traffic.
        path: File of the recording.
        seconds: Duration on the recording's clock, s.
        show: Function called with every new frame, at least once.
        stop: Event that ends the display earlier.
        at_pace: True to play at the pace of the recording.

    Raises:
        ConfigError: The file is not a recording, or its wire differs from `skin.kind`.
        CellError: The recording contains no frame of the skin.
    """
    felt, period = played_skin(config, path, _PlayClock()), 1.0 / config.scan_rate
    shown, reason = -1, "nothing in it"
    try:
        felt.skin.open()
        end = felt.clock.now() + seconds
        while felt.clock.now() <= end and not stop.is_set():
            try:
                shown = _show_new(felt, shown, show)
            except CellError as error:
                reason = str(error)
                if felt.figures is None:  # a text recording has ended; recorded traffic can recover
                    break
            before = felt.clock.now()
            felt.clock.wait_until(before + period)
            if at_pace:  # the recording's clock advances with the waits, not with wall time
                time.sleep(max(felt.clock.now() - before, 0.0))
    except TrafficEndedError:
        pass
    finally:
        felt.skin.close()
    if shown < 0:
        raise ConfigError(f"recording: no frame: {reason}")


def _show_new(felt: SkinLine, shown: int, show: Show) -> int:
    """Read the skin, show its frame unless it has the sequence number `shown`, and return the frame's number."""
    frame = felt.skin.read()
    if frame.sequence != shown:
        show(SeenFrame(frame, None if felt.figures is None else felt.figures()))
    return frame.sequence


def as_data(seen: SeenFrame) -> dict[str, Any]:
    """Return a frame as data for programs."""
    frame, figures = seen.frame, seen.figures
    data: dict[str, Any] = {
        "stamp": frame.stamp,
        "sequence": frame.sequence,
        "values": frame.values.round(1).tolist(),
        "trusted": frame.trusted.tolist(),
    }
    if figures is not None:
        plain = {name: finite(value) for name, value in asdict(figures).items() if name != "temperature"}
        data["figures"] = plain | {"temperature": [finite(value) for value in figures.temperature.tolist()]}
    return data


def fingers(seen: SeenFrame, layout: Layout) -> Group:
    """Return both fingers for a terminal, each taxel at its position, with a line on the reception of the skin."""
    frame, figures = seen.frame, seen.figures
    table = Table(show_edge=False, pad_edge=False)
    for name in FINGER_NAMES:
        table.add_column(f"{name} finger", no_wrap=True)
    places = finger_positions(layout)
    table.add_row(*(_finger(places[k], frame.values[k], frame.trusted[k]) for k in range(FINGERS)))
    line = f"frame {frame.sequence}  {int(frame.trusted.sum())} of {frame.trusted.size} taxels trusted"
    if figures is not None:
        heat = " ".join("-" if np.isnan(value) else f"{value:.0f}" for value in figures.temperature)
        line += f"  {figures.rate:.1f} Hz  {figures.lost} lost  {figures.refused} refused  temperature {heat}"
    scale = Text.assemble(
        "0 ", *((" ", f"on {_ink(BRIGHT * n / 30)}") for n in range(31)), f" {BRIGHT / 1e3:g} k counts; "
    )
    return Group(table, scale.append(f"noise below {NOISE / 1e3:g}; x3: taxel 3 is not trusted"), Text(line))


class _PlayClock:
    """Clock for a recording that has no clock of its own; the time advances with each wait."""

    def __init__(self) -> None:
        self._time = 0.0

    def now(self) -> float:
        return self._time

    def wait_until(self, stamp: float) -> None:
        self._time = max(stamp, self._time)


def _ink(counts: float) -> str:
    """Return the colour of a reading for a terminal."""
    red, green, blue = touch_colours(felt(np.array(counts))).round().astype(int)
    return f"rgb({red},{green},{blue})"


def _finger(places: Vector, values: Vector, trusted: Mask) -> Text:
    """Return one finger, one line per row of taxels across it; the tip of the hand points down."""
    x, y = places.T.round(4) * 1e3
    # Length across the finger represented by one character, mm; both fingers fit into 80 columns.
    columns = np.rint((y - y.min()) / 1.3).astype(int)
    text = Text()
    for row in sorted(set(x)):
        at = 0
        for k in sorted(np.flatnonzero(x == row), key=lambda k: int(columns[k])):
            text.append(" " * max(int(columns[k]) - at, 0))
            # Width of one taxel in the terminal, characters.
            at = max(int(columns[k]), at) + 5
            ink = "black" if values[k] > BRIGHT / 2 else "white"
            reading = (f"{values[k] / 1e3:4.1f} ", f"{ink} on {_ink(values[k])}")
            text.append(*(reading if trusted[k] else (f"{f'x{k}':>4} ", "red")))
        text.append("\n")
    return text
