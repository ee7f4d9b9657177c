"""Whole trials on the cell's own arm and on an externally described one, seed by seed."""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cell.lab.frontier.measure import Variant
from cell.lab.frontier.measure import measure as run_variants
from cell.lab.opinion.figures import Comparison
from cell.lab.results import TrialsResult, result_of
from cell.lab.rows import write_rows
from cell.lab.trials import TABLE as ROWS
from cell.lab.trials import TrialRow, read_table
from cell.records.statistics import Z95
from drivers.errors import ConfigError
from sim.described_arm import DescribedArm
from skills.contract import Outcome

TABLE = "opinion.csv"
OURS, THEIRS = "the cell's own arm", "the described arm"
PACKAGE, FILE, BELIEF = "franka_sim", "models/fr3.urdf", "arm.model=fr3"
"""Package with a description of the arm, its file there, and the key of the described arm."""


class Part(NamedTuple):
    """Part of a description that is tested alone."""

    figures: str
    """Figures that must differ, of `Comparison.differs`."""
    takes: tuple[str, ...]
    """Properties taken from the description, see `sim.described.takes`."""


PARTS = {
    "its kinematics alone": Part("kinematics", ("kinematics",)),
    "its inertia alone, weightless": Part("inertia", ("inertia",)),
    "its inertia alone": Part("inertia", ("inertia", "gravity")),
    "its friction alone": Part("friction", ("friction",)),
    "its rotors alone": Part("rotors", ("rotors",)),
}
"""Parts by name; links with weight leave a residual torque that the controller does not compensate."""
LINKS = "its links alone"
"""Name of kinematics and weighted links together, tested if neither differs; the result must then be the same."""
EVERYTHING = ("kinematics", "inertia", "gravity", "friction", "rotors")


@dataclass(frozen=True, slots=True)
class OpinionLine:
    """Trials on one arm, and their differences from the cell's own arm on the same seeds."""

    result: TrialsResult
    depth: float
    """Median depth of the tip in the hole over the successes, m; NaN where there are none."""
    pairs: int
    """Number of seeds with success on both arms."""
    slower: float
    """Mean difference of the total time over those seeds, this arm minus the cell's own, s."""
    slower_error: float
    """Half width of its 95 % interval, normal, s; NaN for fewer than two pairs."""
    harder: float
    """Median difference of the largest contact force over all seeds, N."""
    won: int
    """Number of seeds with success on this arm and not on the cell's own."""
    lost: int
    """Number of seeds with success on the cell's own arm and not on this one."""


def shipped_description() -> Path:
    """Return the description in a package.

    Raises:
        ConfigError: The package is not installed.
    """
    found = find_spec(PACKAGE)
    places = list(found.submodule_search_locations or ()) if found else []
    if not places or not (file := Path(places[0], FILE)).is_file():
        raise ConfigError(
            "study opinion: no description of an arm; name a URDF or MJCF file with --model, or install one, without the older "
            "packages that it asks for: pip install --no-deps -c constraints.txt franka-sim"
        )
    return file


def variants(described: DescribedArm, path: Path, compared: Comparison) -> list[Variant]:
    """Return the cell's own arm, the described one, and each differing part of it alone."""
    found = [Variant("opinion", OURS, None, ())]
    single = {name: part.takes for name, part in PARTS.items() if part.figures in compared.differs}
    if not {"kinematics", "inertia"} & set(compared.differs):
        single = {LINKS: ("kinematics", "inertia", "gravity"), **single}
    found += [Variant("opinion", name, None, (_key(described, path, takes),)) for name, takes in single.items()]
    return [*found, Variant("opinion", THEIRS, None, (_key(described, path, EVERYTHING),))]


def _key(described: DescribedArm, path: Path, takes: tuple[str, ...]) -> str:
    words = {"file": str(path.resolve()), "flange": described.flange, "sha256": described.digest, "takes": list(takes)}
    return f"sim.described={{{', '.join(f'{key} = {json.dumps(value)}' for key, value in words.items())}}}"


def measure(
    path: Path | None,
    sets: Sequence[str],
    tried: Sequence[Variant],
    seeds: range,
    workers: int,
    folder: Path,
    done: Callable[[int], None],
) -> list[OpinionLine]:
    """Run every variant on the same seeds, the cell's own arm first; finished trials in the folder are reused.

    Args:
        path: TOML file of the cell; None is the simulated cell that ships with the program.
        sets: Keys of all variants.
        tried: Variants, from `variants`.
        seeds: Seeds, one trial each.
        workers: Number of processes.
        folder: Folder of the variants' folders.
        done: Called with the number of further completed trials.
    """
    found: list[OpinionLine] = []
    ours: list[TrialRow] = []
    for variant, line in zip(tried, run_variants(path, sets, tried, seeds, workers, folder, done), strict=True):
        rows = read_table(folder / line.folder / ROWS) if line.trials else []
        ours = rows if variant.name == OURS else ours
        found.append(_line(result_of(variant.name, rows, line.error), rows, ours))
    return found


def _line(result: TrialsResult, rows: Sequence[TrialRow], ours: Sequence[TrialRow]) -> OpinionLine:
    own = {row.seed: row for row in ours}
    pairs = [(own[row.seed], row) for row in rows if row.seed in own]
    both = [(a, b) for a, b in pairs if a.outcome == b.outcome == Outcome.SUCCESS]
    times = np.array([(b.total_time or 0.0) - (a.total_time or 0.0) for a, b in both])
    forces = [b.peak_contact_force - a.peak_contact_force for a, b in pairs]
    depths = [row.depth for row in rows if row.outcome == Outcome.SUCCESS]
    return OpinionLine(
        result=result,
        depth=float(np.median(depths)) if depths else math.nan,
        pairs=len(both),
        slower=float(times.mean()) if both else math.nan,
        slower_error=Z95 * float(times.std(ddof=1)) / math.sqrt(len(both)) if len(both) > 1 else math.nan,
        harder=float(np.median(forces)) if forces else math.nan,
        won=sum(b.outcome == Outcome.SUCCESS != a.outcome for a, b in pairs),
        lost=sum(a.outcome == Outcome.SUCCESS != b.outcome for a, b in pairs),
    )


def write(lines: Sequence[OpinionLine], path: Path) -> Path:
    """Write one row per line as CSV; return the file."""
    rows = [{**(told := asdict(line)).pop("result"), **told} for line in lines]
    return write_rows(rows, path)
