"""`cell calibrate`: measured figures of a device, in a dated file."""

import argparse
import sys
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

from cell.arguments import add_config, load_config
from cell.terminal import GOOD, ask, progress, show
from drivers.errors import ConfigError

if TYPE_CHECKING:
    from rich.table import Table

    from drivers.skin.calibration import SkinCalibration

SUMMARY = "measure a device and write a dated file"
STOPS_ITSELF = False


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add which device, and where the file goes."""
    add_config(parser)
    parser.add_argument("device", choices=["skin"], metavar="DEVICE", help="skin")
    parser.add_argument("--out", type=Path, metavar="DIR", help="instead of calibration/ beside the config file")


def run(args: argparse.Namespace) -> int:
    """Measure, write the file, and show what was found."""
    from cell.calibrate import calibrate_skin
    from cell.config_files import DEFAULT

    today = date.today()
    config = load_config(args).cell
    path = (args.out or (args.config or DEFAULT).parent / "calibration") / f"skin_{today.isoformat()}.toml"
    if not config.is_skin_simulated() and not sys.stdin.isatty():
        raise ConfigError("calibrate skin: somebody has to turn a rod between the pads; a terminal needed")
    with progress() as bars:
        bar = bars.add_task("angles")
        found = calibrate_skin(config, today, lambda done, of: bars.update(bar, completed=done, total=of), ask)
    found.write(path)
    show(args, _table(found, path), {**found.model_dump(mode="json"), "file": str(path)})
    return GOOD


def _table(found: "SkinCalibration", path: Path) -> "Table":
    import numpy as np
    from rich.table import Table

    table = Table("skin", "value", title=f"written: {path}")
    gains = np.array([found.left, found.right])
    table.add_row("gains, smallest to largest", f"{gains.min():.3f} to {gains.max():.3f}")
    table.add_row("gains, standard deviation", f"{gains.std():.3f}")
    table.add_row("taxels that could not be measured", str(sum(map(len, found.unmeasured))))
    table.add_row("point spread (mm)", f"{found.point_spread * 1e3:.2f}")
    table.add_row("not explained", f"{found.residual:.1%}")
    return table
