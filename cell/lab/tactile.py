"""Accuracy and speed of each estimator of the peg's angle, and the share of frames in which its sigma covers the error.

Frames come from two models of the pads that differ from the estimators' templates: the simulation's bed of springs, and
an independent, more detailed elastic layer. Both pass through the simulated taxels (gains, offsets, drift, noise,
converter) and the health check of the live skin. The frames of one kind have random angles, one after the other. An
estimator that adapts to the pads starts anew with each kind.
"""

import argparse
import math
import time
from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from cell.commands.arguments import out_folder
from cell.config.cell_config import CellConfig
from cell.devices.assembly import make_estimator
from cell.lab.arguments import advancing, load_simulated
from cell.lab.charts import BLUE, GREEN, GREY, PURPLE, Curve, Panel, draw_panels
from cell.lab.elastic_layer import layer_pads
from cell.lab.report import StudyReport, reported
from cell.lab.tables import Columns, table
from drivers.errors import ConfigError
from drivers.parts import Peg
from drivers.quantities import TaxelFrame, Vector
from drivers.skin.health import SkinHealth
from drivers.skin.layout import LAYOUTS, Layout, layout_of, module_of
from sim.config import SimSkinConfig
from sim.hand.pads import PadLoad, Pads
from sim.hand.skin import Taxels
from skills.catalogue import INSERT
from skills.tactile.estimators import ESTIMATORS
from skills.tactile.pose import Estimator

LOOKS = ((GREY, "s"), (BLUE, "^"), (PURPLE, "o"), (GREEN, "v"))
"""Colours and markers of the estimators, in their order."""
Model = Literal["springs", "layer"]
FRAMES, QUICK_FRAMES = 800, 40
BETWEEN = 2.0
"""Time between two grasps, s; the offsets drift continuously."""
WIDEST = math.radians(80.0)
GRIP = 30.0
PUSH, LEVER = 7.0, 0.045
"""Largest force across the pads, N, and its mean lever about the finger centre, m, as in a search."""
DEPTHS = (0.45e-3, 0.6e-3)
"""Depths of the peg in the layer, m."""


@dataclass(frozen=True, slots=True)
class Condition:
    """Conditions of a grasp or a skin that differ from the nominal ones."""

    name: str
    noise: float = 1.0
    """Multiple of the configured noise."""
    sensitivity: float = 1.0
    """Multiple of the configured sensitivity; a high value saturates the converter."""
    dead: Literal["none", "known", "unknown"] = "none"
    """Fault of one module, drawn for each skin: `known` reads zero from the start, `unknown` reads only noise after the baseline."""
    off_centre: tuple[float, float] | None = None
    """Range of the magnitude of the random offset, to either side, m; None for a normal offset about the finger centre."""
    reach_back: tuple[float, float] | None = None
    """Range of the random length of the peg beyond the finger centre, inside the hand, m; None for the stated length."""
    forgets: bool = False
    """True if every frame is the estimator's first."""


CONDITIONS = (
    Condition("nominal"),
    Condition("first frame", forgets=True),
    Condition("module dead, known", dead="known"),
    Condition("module dead, unknown", dead="unknown"),
    Condition("noise doubled", noise=2.0),
    Condition("2 to 3 mm off centre", off_centre=(2e-3, 3e-3)),
    Condition("half contact", reach_back=(0.0, 4e-3)),
    Condition("saturated", sensitivity=6.0),
)
ON_LAYER = CONDITIONS[:4]
"""Conditions also tested on the elastic layer, which takes longer to compute."""


@dataclass(frozen=True, slots=True)
class Read:
    """Result of one frame and one estimator."""

    error: float
    """Estimated angle minus the true one, folded to half a turn, rad."""
    sigma: float
    healthy: bool
    spent: float
    """Time spent, s."""


@dataclass(frozen=True, slots=True)
class TactileLine:
    """Result of one estimator on one kind of frames; errors are those of the reported angles, degrees."""

    layout: str
    model: str
    condition: str
    estimator: str
    frames: int
    told: float
    """Share of frames with a reported angle, fraction."""
    rmse: float
    p95: float
    worst: float
    covered: float
    """Share of reported angles with an error within 1.96 sigma; 0.95 if sigma is correct."""
    time: float
    """Median time for one frame, s."""


def study(config: CellConfig, is_quick: bool, done: Callable[[int], None]) -> list[TactileLine]:
    """Estimate frames of every kind with every estimator.

    Args:
        config: Config of a cell with a simulated skin.
        is_quick: True for a twentieth of the frames.
        done: Called with 1 after every kind of frames.
    """
    count = QUICK_FRAMES if is_quick else FRAMES
    lines: list[TactileLine] = []
    for layout in LAYOUTS:
        config = config.model_copy(update={"skin": config.skin.model_copy(update={"layout": layout})})
        estimators = {name: make_estimator(config.with_params(INSERT, estimator=name)) for name in ESTIMATORS}
        for model, condition in kinds():
            frames = list(made(config, model, condition, count))
            for name, estimator in estimators.items():
                copy(estimator).estimate(frames[0][1])
                reads = reads_of(estimator, frames, condition.forgets)
                lines.append(summed(layout, model, condition.name, name, reads))
            done(1)
    return lines


def kinds() -> list[tuple[Model, Condition]]:
    """Return the kinds of frames for each layout."""
    return [*(("springs", condition) for condition in CONDITIONS), *(("layer", condition) for condition in ON_LAYER)]


def made(config: CellConfig, model: Model, condition: Condition, count: int) -> Iterator[tuple[float, TaxelFrame]]:
    """Yield the true angle, rad, and the frame of each grasp; repeated calls yield the same.

    Raises:
        ConfigError: The skin is not simulated.
    """
    if not isinstance(config.skin, SimSkinConfig):
        raise ConfigError(f'study tactile: skin.kind = "{config.skin.kind}": its pegs are simulated; "sim" allowed')
    skin, layout = config.skin, config.skin.layout
    rng = np.random.default_rng(np.random.SeedSequence([list(LAYOUTS).index(layout), *condition.name.encode()]))
    skin = skin.model_copy(
        update={
            "noise": min(condition.noise * skin.noise, 0.2),
            "sensitivity": condition.sensitivity * skin.sensitivity,
        }
    )
    pads, number_of = Pads(skin.pad, layout), module_of(layout)
    angles = rng.permutation(np.linspace(-WIDEST, WIDEST, count))
    for number, theta in enumerate(angles):
        # Number of grasps per draw of the taxels' gains.
        if number % 8 == 0:
            taxels, feels = Taxels(skin, rng), np.ones_like(number_of, dtype=bool)
            module = int(rng.integers(number_of.max() + 1))
            if condition.dead == "known":
                taxels.dead = taxels.dead | (module == number_of)
            elif condition.dead == "unknown":
                feels = np.not_equal(module, number_of)
            rest = np.zeros(number_of.shape)
            still = np.array([taxels.measure(rest, 0.0) for _ in range(skin.health.baseline_frames)])
            health = SkinHealth(skin.health, still, layout_of(layout).full_scale)
        # Standard deviation of the peg's offset from the finger centre, m.
        offset = rng.normal(0.0, 0.7e-3)
        if condition.off_centre is not None:
            offset = rng.choice([-1.0, 1.0]) * rng.uniform(*condition.off_centre)
        back = config.peg.overhang if condition.reach_back is None else rng.uniform(*condition.reach_back)
        grasp = _grasped if model == "springs" else _pressed
        pressure = grasp(pads, layout, float(theta), offset, back, config, rng)
        values, trusted = health.update(taxels.measure(np.where(feels, pressure, 0.0), BETWEEN), BETWEEN * number)
        yield float(theta), TaxelFrame(values, trusted, BETWEEN * number, number)


def _grasped(
    pads: Pads, layout: Layout, theta: float, offset: float, back: float, config: CellConfig, rng: np.random.Generator
) -> Vector:
    push, face = rng.uniform(-PUSH, PUSH), config.peg.part.face
    load = PadLoad(theta, offset, GRIP, push, LEVER * push, config.peg.length, back, face.width, face.is_flat)
    return pads.pressure(load)


def _pressed(
    pads: Pads, layout: Layout, theta: float, offset: float, back: float, config: CellConfig, rng: np.random.Generator
) -> Vector:
    depth = rng.uniform(*depths_of(config.peg, layout))
    move, tilt = depth * rng.uniform(-0.1, 0.1), depth / 0.02 * rng.uniform(-0.15, 0.15)
    depths = ((depth + move, tilt), (depth - move, -tilt))
    reach = (config.peg.length, back)
    return layer_pads(layout).readings(theta, offset, depths, reach, config.peg.part.face)[0]


@lru_cache
def depths_of(peg: Peg, layout: Layout) -> tuple[float, float]:
    """Return the depths of a peg in the layer, m: `DEPTHS`, or for a flat face depths of equal load.

    The load of a flat face is proportional to its depth, because the face touches the layer over its whole area. The depths
    are scaled so that their mean carries the grip force.
    """
    face, reach = peg.part.face, (peg.length, peg.overhang)
    if not face.is_flat:
        return DEPTHS
    low, high = DEPTHS
    middle = (low + high) / 2
    load = float(layer_pads(layout).readings(0.0, 0.0, ((middle, 0.0), (middle, 0.0)), reach, face)[1].mean())
    return low * GRIP / load, high * GRIP / load


def reads_of(estimator: Estimator, frames: Sequence[tuple[float, TaxelFrame]], forgets: bool) -> list[Read]:
    """Return an estimator's results for frames, each given with the peg's true angle, rad.

    Args:
        estimator: Estimator before its first frame; only a copy of it is used.
        frames: True angles, rad, and frames.
        forgets: True if every frame is the estimator's first.
    """
    reader, reads = copy(estimator), []
    for theta, frame in frames:
        reader = copy(estimator) if forgets else reader
        started = time.perf_counter()
        pose = reader.estimate(frame)
        spent = time.perf_counter() - started
        error = (pose.theta - theta + math.pi / 2) % math.pi - math.pi / 2
        reads.append(Read(error, pose.sigma, pose.healthy, spent))
    return reads


def summed(layout: str, model: str, condition: str, estimator: str, reads: Sequence[Read]) -> TactileLine:
    """Return the summary line of the results; its errors are NaN if no angle was reported."""
    told = [read for read in reads if read.healthy]
    error = np.abs([read.error for read in told]) if told else np.array([math.nan])
    sigma = np.array([read.sigma for read in told]) if told else np.array([math.nan])
    degrees = np.degrees(error)
    return TactileLine(
        layout=layout,
        model=model,
        condition=condition,
        estimator=estimator,
        frames=len(reads),
        told=len(told) / len(reads),
        rmse=float(np.sqrt(np.mean(degrees**2))),
        p95=float(np.percentile(degrees, 95)),
        worst=float(degrees.max()),
        covered=float(np.mean(error < 1.96 * sigma)),
        time=float(np.median([read.spent for read in reads])),
    )


def panels(lines: Sequence[TactileLine]) -> list[Panel]:
    """Return the error at nominal noise against the time for one frame, for each layout.

    A filled symbol is the bed of springs, a hollow one the elastic layer; bars reach to the worst error.
    """
    found, look = [], {name: LOOKS[n % len(LOOKS)] for n, name in enumerate(ESTIMATORS)}
    for layout in LAYOUTS:
        curves = [
            Curve(
                [1e6 * line.time],
                [line.rmse],
                *(look[line.estimator][0], f"{line.estimator}, {line.model}", look[line.estimator][1], 2.0),
                low=[line.rmse],
                high=[line.worst],
                is_hollow=line.model == "layer",
            )
            for line in lines
            if (line.layout, line.condition) == (layout, CONDITIONS[0].name)
        ]
        ticks = ((10, 20, 50, 100, 200), (0.5, 1, 2, 5, 10, 20))
        labels = "median time for one frame (us)", "error of theta (degrees)"
        title = f"{layout.replace('_', ' ')}; n = {max(line.frames for line in lines)}"
        found.append(Panel(title, *labels, curves, "xy", *ticks))
    return found


def run(args: argparse.Namespace) -> StudyReport:
    """Estimate frames of every kind, write the table, draw the chart."""
    config, folder = load_simulated(args).cell, out_folder(args.out)
    with advancing("frames", len(LAYOUTS) * len(kinds())) as done:
        lines = study(config, args.quick, done)
    names: Columns = {
        "layout": lambda line: line.layout,
        "pads": lambda line: line.model,
        "frames": lambda line: line.condition,
    }
    columns: Columns = {
        "estimator": lambda line: line.estimator,
        "n": lambda line: f"{line.frames}",
        "reported": lambda line: f"{100 * line.told:.1f} %",
        "RMS error (deg)": lambda line: f"{line.rmse:.2f}",
        "p95": lambda line: f"{line.p95:.2f}",
        "worst": lambda line: f"{line.worst:.2f}",
        "in 1.96 sigma": lambda line: f"{line.covered:.2f}",
        "us": lambda line: f"{1e6 * line.time:.0f}",
    }
    shown = table("Estimators of the peg's angle", names, columns, lines)
    title = "Nominal noise. Symbol: RMS error, bar: to the worst; filled: bed of springs, hollow: elastic layer"
    chart = draw_panels(panels(lines), title, folder / "tactile_speed_accuracy.png", legend=6)
    return reported(shown, folder, {"tactile.csv": lines}, [chart], lines=lines)
