"""`cell skin`: show the readings of both fingers, live or from a recording."""

import argparse
import math
import sys
from contextlib import nullcontext
from pathlib import Path

from rich.live import Live

from cell.commands import skin_view
from cell.commands.arguments import add_config, file_path, load_config
from cell.commands.skin_view import SeenFrame
from cell.commands.terminal import GOOD, console, show


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the duration, and the files to record, replay and draw."""
    add_config(parser)
    parser.add_argument("--seconds", type=float, metavar="S", help="duration, s; default no limit, 1 s in a pipe")
    parser.add_argument("--out", type=file_path, metavar="PNG", help="picture of the last frame")
    parser.add_argument("--record", type=file_path, metavar="FILE", help="file that records the bytes from the board")
    parser.add_argument("--replay", type=Path, metavar="FILE", help="file of --record, or text recording of CySkin")


def run(args: argparse.Namespace) -> int:
    """Show the newest frame until the end on a terminal, or only the last one in a pipe."""
    args.set += [] if args.record is None else [f"skin.record={args.record.as_posix()}"]
    config = load_config(args).cell
    is_live = sys.stdout.isatty() and not args.json
    seconds = args.seconds if args.seconds is not None else math.inf if is_live else 1.0
    seen: list[SeenFrame] = []
    with Live(console=console(), auto_refresh=False) if is_live else nullcontext() as live:

        def tell(now: SeenFrame) -> None:
            seen[:] = [now]
            if live is not None:
                live.update(skin_view.fingers(now, config.skin.layout), refresh=True)

        if args.replay is None:
            skin_view.watch(config, seconds, tell, args.stop)
        else:
            skin_view.play(config, args.replay, seconds, tell, args.stop, at_pace=is_live)
    if args.out is not None:
        from cell.film.plots import draw_fingers

        draw_fingers(seen[0].frame, config.skin.layout, args.out)
    if not is_live:
        show(args, skin_view.fingers(seen[0], config.skin.layout), skin_view.as_data(seen[0]))
    return GOOD
