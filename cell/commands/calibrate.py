"""`cell calibrate`: measure the figures of a device and write them to a dated file."""

import argparse
import math
import sys
from dataclasses import asdict
from datetime import date
from pathlib import Path

import numpy as np
from rich.console import Group
from rich.table import Table

from cell.calibrate.arm import calibrate_arm
from cell.calibrate.places import PEGS, MeasuredPlaces, calibrate_places
from cell.calibrate.proven import keep
from cell.calibrate.skin import calibrate_skin
from cell.commands.arguments import (
    add_calibration_folder,
    add_config,
    calibration_folder,
    load_proven,
    positive,
    proven_file,
)
from cell.commands.terminal import ask, complain, counting, filled, show
from cell.config.cell_config import CellConfig
from drivers.arm.calibration import ArmCalibration
from drivers.errors import ConfigError, NotCalibratedError
from drivers.skin.calibration import SkinCalibration


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the device and the output folder."""
    add_config(parser)
    parser.add_argument("device", choices=list(DEVICES), metavar="DEVICE", help=" or ".join(DEVICES))
    parser.add_argument("--pegs", type=positive, metavar="N", help="places: number of pegs to touch with; default 3")
    add_calibration_folder(parser)


def run(args: argparse.Namespace) -> int:
    """Measure the device, write the file and show the result; at reduced speed and force until all facts are proven."""
    today = date.today()
    if args.pegs is not None and args.device != "places":
        raise ConfigError("--pegs: only for places")
    config = load_proven(args)[0].cell
    path = calibration_folder(args) / f"{args.device}_{today.isoformat()}.toml"
    try:
        return DEVICES[args.device](args, config, today, path)
    except NotCalibratedError as error:
        return complain(f"{error}; nothing written")


def _skin(args: argparse.Namespace, config: CellConfig, today: date, path: Path) -> int:
    if not config.is_skin_simulated() and not sys.stdin.isatty():
        raise ConfigError("calibrate skin: a person must turn a rod between the pads; a terminal needed")
    with counting("angles") as done:
        found = calibrate_skin(config, today, done, ask)
    return _written(args, found, _skin_table(found, path), path)


def _arm(args: argparse.Namespace, config: CellConfig, today: date, path: Path) -> int:
    with counting("motions") as done:
        found = calibrate_arm(config, today, done)
    return _written(args, found, _arm_table(found, config, path), path)


def _places(args: argparse.Namespace, config: CellConfig, today: date, path: Path) -> int:
    pegs = PEGS if args.pegs is None else args.pegs
    # If a feeder refills the rack, its slots do not limit the number of pegs.
    most = config.rack.slots if config.rack.refill == "asked" else 20
    if most < 2:
        raise ConfigError('rack.slots = 1: two pegs needed; 2 or more, or rack.refill = "feeder" allowed')
    if not 2 <= pegs <= most:
        raise ConfigError(f"--pegs {pegs}: 2 to {most} allowed")
    with counting("touches") as done:
        found = calibrate_places(config, today, done, pegs)
    found.write(path)
    if not config.is_simulated:
        keep(proven_file(args), found.corrected(config), {"places": f"{pegs} pegs, see {path.name}"}, today)
    data = {**asdict(found), "date": today.isoformat(), "file": str(path), "write": found.sections}
    return show(args, _places_table(found, config, path), data)


DEVICES = {"skin": _skin, "arm": _arm, "places": _places}
"""Function that calibrates each device."""


def _written(args: argparse.Namespace, found: SkinCalibration | ArmCalibration, table: Table, path: Path) -> int:
    """Write the calibration file of a device; show its table, and the lines that add it to the cell's file."""
    found.write(path)
    named = f'for the cell\'s file:\n\n[calibration]\n{args.device} = "{path.resolve()}"\n'
    return show(args, Group(table, named), {**found.model_dump(mode="json"), "file": str(path)})


def _skin_table(found: SkinCalibration, path: Path) -> Table:
    gains = np.array([found.left, found.right])
    rows = (
        ("gains, smallest to largest", f"{gains.min():.3f} to {gains.max():.3f}"),
        ("gains, standard deviation", f"{gains.std():.3f}"),
        ("taxels that could not be measured", str(sum(map(len, found.unmeasured)))),
        ("point spread (mm)", f"{found.point_spread * 1e3:.2f}"),
        ("not explained", f"{found.residual:.1%}"),
    )
    return filled(("skin", "value"), rows, title=f"written: {path}")


def _arm_table(found: ArmCalibration, config: CellConfig, path: Path) -> Table:
    joints = config.arm_model().joints
    caption = (
        "N·m, ± half the width of the 95 % interval; published: friction, and standard deviation of the offset, of the"
        " arm file"
    )
    table = Table(title=f"{found.arm}, {found.unit}; written: {path}", caption=caption)
    speeds = [f"friction at {v:g} rad/s" for v in found.speeds]
    for name in ("joint", *speeds, "published", "offset", "published", "left", "verdict"):
        table.add_column(name, justify="left" if name == "verdict" else "right")
    for j in range(len(joints.friction)):
        table.add_row(
            str(j + 1),
            *(_figure(each.value[j], each.interval[j]) for each in found.friction),
            f"{joints.friction[j]:.2f}",
            _figure(found.offset.value[j], found.offset.interval[j]),
            f"± {joints.offset[j]:.2f}",
            f"{found.unexplained[j]:.2f}",
            _verdict(found, j, joints.friction[j], joints.offset[j]),
        )
    return table


def _figure(value: float, interval: float) -> str:
    return f"{value:.2f} ± {interval:.2f}"


def _verdict(found: ArmCalibration, joint: int, friction: float, offset: float) -> str:
    """Return the figures of a joint that are outside their expected range, or `as expected`."""
    # Expected ratio of measured to published friction; the range of `config/reality.toml`, tested by `cell study
    # margins`.
    low, high = 0.5, 2.0
    share = found.friction[-1].value[joint] / friction if friction > 0.0 else 1.0
    told = []
    if not low <= share <= high:
        told.append(f"friction {share:.1f} times the published: {low:g} to {high:g} expected")
    # Largest expected offset, in standard deviations from the arm file.
    if abs(found.offset.value[joint]) > 2.0 * offset:
        told.append("offset: check the payload that is set in the arm's controller")
    return "; ".join(told) or "as expected"


def _places_table(found: MeasuredPlaces, config: CellConfig, path: Path) -> Group:
    def mm(value: float) -> str:
        return f"{value * 1e3:+.2f}"

    def within(value: float) -> str:
        return f"± {value * 1e3:.2f}"

    rack = zip("xy", found.rack, found.rack_interval, strict=True)
    rows = (
        ("plate, height in the middle", mm(found.height - config.hole.centre[2]), within(found.height_interval)),
        ("plate, tilt (degrees)", f"{math.degrees(found.tilt):.2f}", ""),
        ("plate, uneven (rms)", f"{found.uneven * 1e3:.2f}", ""),
        *((f"rack, along {axis}", mm(off), within(interval)) for axis, off, interval in rack),
        *((f"peg {n}, protrusion minus the mean", mm(off), "") for n, off in enumerate(found.pegs, 1)),
    )
    title, caption = f"{found.unit}; written: {path}", "mm, values measured by this arm minus those of the config"
    table = filled(("place", "off by", "95 %"), rows, title=title, caption=caption)
    told = (
        f"for the cell's file:\n\n{found.sections}"
        if found.sections
        else "every place agrees with the file within its interval"
    )
    return Group(table, told)
