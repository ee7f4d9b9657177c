"""Trials of hands that measure theta throughout, only in the grasp, or assume 0."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cell.config.files import presets
from cell.devices.assembly import make_tracker
from cell.lab.frontier.measure import Variant
from cell.lab.frontier.measure import measure as run_variants
from cell.lab.results import TrialsResult, result_of
from cell.lab.touch.blind import frozen, straight
from cell.lab.trials import TABLE as ROWS
from cell.lab.trials import MakeTracker, read_table
from drivers.errors import ConfigError

TABLE = "touch.csv"
SIGHTS: Mapping[str, MakeTracker] = {
    "touch": make_tracker,
    "frozen after the grasp": frozen,
    "theta = 0": straight,
}
"""Function that creates the tracker, by the hand's measurement of theta; the first is the unchanged hand."""
TURNING = "turning pegs"
"""Name of the regime in which the peg rotates in the hand by tens of degrees, as [gibbons] reports."""
TURNING_KEYS = ("grasp.force=15.0", "grip.friction=0.3")
"""Keys of that regime on top of the default preset: with this grip and these pads the push over the plate rotates the
peg."""
QUICK = (TURNING,)
"""Hands of a quick study without named hands."""


@dataclass(frozen=True, slots=True)
class Hand:
    """One combination of grip and settings."""

    name: str
    preset: str | None
    sets: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class TouchLine:
    """Trials of one hand with one measurement of theta."""

    hand: str
    sight: str
    result: TrialsResult


def hands(path: Path | None, names: Sequence[str] = ()) -> list[Hand]:
    """Return every preset of the cell at `path` and the regime of rotating pegs, or only the named ones.

    Raises:
        ConfigError: A hand of that name does not exist.
    """
    found = {name: Hand(name, name) for name in sorted(presets(path))}
    found[TURNING] = Hand(TURNING, None, TURNING_KEYS)
    for name in names:
        if name not in found:
            raise ConfigError(f"--hand {name}: no such hand; {', '.join(found)} allowed")
    return [found[name] for name in names or found]


def measure(
    path: Path | None,
    sets: Sequence[str],
    tried: Sequence[Hand],
    seeds: range,
    workers: int,
    folder: Path,
    done: Callable[[int], None],
) -> list[TouchLine]:
    """Run every hand with every sight on the same seeds; finished trials in the folder are reused.

    Args:
        path: TOML file of the cell; None is the simulated cell that ships with the program.
        sets: Keys of all trials.
        tried: Hands to run.
        seeds: Seeds, one trial each.
        workers: Number of processes.
        folder: Folder of the trials' folders.
        done: Called with the number of further completed trials.
    """
    cases = [(hand, sight) for hand in tried for sight in SIGHTS]
    variants = [Variant(hand.name, sight, hand.preset, hand.sets, SIGHTS[sight]) for hand, sight in cases]
    found = []
    lines = run_variants(path, sets, variants, seeds, workers, folder, done)
    for (hand, sight), line in zip(cases, lines, strict=True):
        rows = read_table(folder / line.folder / ROWS) if line.trials else []
        found.append(TouchLine(hand.name, sight, result_of(f"{hand.name}, {sight}", rows, line.error)))
    return found
