"""`cell teach`: record the places of rack, plate, hole and bin, shown by hand."""

import argparse
from datetime import date

import numpy as np

from cell.calibrate import taught
from cell.calibrate.hand_motion import moved_by_keys
from cell.calibrate.keys import keys
from cell.calibrate.places import sections
from cell.commands.arguments import add_calibration_folder, add_config, calibration_folder, load_config
from cell.commands.terminal import complain, say, show
from cell.config.load import load
from cell.devices.assembly import assemble, opened
from drivers.errors import ConfigError
from drivers.figures_file import write_whole
from drivers.frames import end_point
from drivers.quantities import ArmState


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the length of the pointing tool, and the output folder."""
    add_config(parser)
    parser.add_argument(
        "--length",
        type=float,
        metavar="M",
        help="distance from the finger centre to the end that touches the places, m; default that of the cell's peg",
    )
    add_calibration_folder(parser)


def run(args: argparse.Namespace) -> int:
    """Guide or jog the arm, record places by keys, and write them if they are plausible."""
    config, today, folder = load_config(args).cell, date.today(), calibration_folder(args)
    if args.length is not None and not 0.0 < args.length <= 1.0:
        raise ConfigError(f"--length {args.length:g}: a number > 0 and <= 1 m allowed")
    tell = complain if args.json else say
    length, shown, is_wanted = args.length or config.peg.length, taught.Shown(), []

    def act(key: str, state: ArmState) -> bool:
        if key == taught.WRITE:
            is_wanted.append(True)
            return False
        place, axis = end_point(state.tcp, 0.0, length)
        taught.key_taken(shown, config.rack, tell, key, place, axis, float(np.abs(state.dq).max()))
        return True

    with opened(assemble(config), "arm", "gripper") as cell, keys() as pressed:
        meanings = ", ".join(f"{k}: {v}" for k, v in taught.MEANINGS.items())
        tell(f"Keep the stop in reach; guide the arm. Keys: {meanings}")
        moved_by_keys(cell, pressed, act, is_guided=True)
    found = taught.lines(shown, config.hole, config.rack)
    if not is_wanted or not found:
        return complain("teach: nothing written")
    if (why := taught.implausible(shown, config.rack, config.peg.length, config.limits)) is not None:
        return complain(f"teach: {why}; nothing written")
    load(args.config, sets=[*args.set, *(f"{section}.{key}={value}" for section, key, value in found)])
    path = folder / f"taught_{today.isoformat()}.toml"
    text = sections(found)
    head = f"# Shown by hand with `cell teach` on {today}, arm {config.arm_unit()}; for the cell's file. SI units.\n"
    write_whole(path, head + text, "places")
    told = f"written: {path}\nfor the cell's file; run `cell calibrate places` afterwards:\n\n{text}"
    return show(args, told, {"file": str(path), "write": text})
