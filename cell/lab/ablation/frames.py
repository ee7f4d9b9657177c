"""Error of theta on single frames with the whole estimator and without each of its rules; the frames are those of `cell study tactile`."""

from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import dataclass, replace

from cell.config.load import load
from cell.devices.assembly import make_estimator
from cell.lab.ablation.rules import RULES, SCENES
from cell.lab.ablation.switch import Rule, without
from cell.lab.tactile import CONDITIONS, Condition, Model, Read, kinds, made, read, simulated_skin, summed
from drivers.quantities import TaxelFrame
from skills.tactile.pose import Estimator

LAWS = ("hertz", "foam")
"""Scenes whose pads follow another law than the templates assume; only nominal frames are tested on them."""

NOMINAL = CONDITIONS[0]
OTHER_LENGTH = Condition("end 4 mm off", reach_back=(0.011, 0.019))
"""Pegs that end up to 4 mm from the stated place, between the pads."""
STUCK = 8000.0
"""Reading of a single wrong taxel, counts; a peg reads up to twice as much."""


@dataclass(frozen=True, slots=True)
class FramesLine:
    """Errors of the reported angles of one kind of frames, degrees."""

    off: str
    """Name of the rule that was switched off; empty for none."""
    frames: str
    """Pads and condition."""
    told: float
    """Share of frames with a reported angle, fraction."""
    rmse: float
    p95: float
    covered: float
    """Share of reported angles with an error within 1.96 sigma, fraction."""
    time: float
    """Median time for one frame, s."""


def measure(count: int, done: Callable[[int], None]) -> list[FramesLine]:
    """Return the errors of `count` frames of each kind, with all rules of the estimator and without each."""
    tables = list(_frames(count))
    lines = []
    of_frames = ("skills.tactile.robust", "skills.tactile.likelihood")
    for rule in (None, *(rule for rule in RULES.values() if rule.target.startswith(of_frames))):
        for name, frames in tables:
            lines.append(_line(rule, name, frames))
            done(1)
    return lines


def _frames(count: int) -> Iterator[tuple[str, list[tuple[float, TaxelFrame]]]]:
    for model, condition in [*kinds(), ("springs", OTHER_LENGTH), ("layer", OTHER_LENGTH)]:
        yield f"{model}, {condition.name}", _made("honest", model, condition, count)
    for law in LAWS:
        yield law, _made(law, "springs", NOMINAL, count)
    yield (
        "one wrong taxel",
        [(theta, _spoilt(frame, n)) for n, (theta, frame) in enumerate(_made("honest", "springs", NOMINAL, count))],
    )


def _made(scene: str, model: Model, condition: Condition, count: int) -> list[tuple[float, TaxelFrame]]:
    config = load(sets=SCENES[scene]).cell
    return list(made(simulated_skin(config), config.skin.layout, model, condition, count, config))


def _spoilt(frame: TaxelFrame, number: int) -> TaxelFrame:
    """Return the frame with one taxel at `STUCK`, another one in each frame."""
    values = frame.values.copy()
    values.flat[number % values.size] = STUCK
    return replace(frame, values=values)


def _line(rule: Rule | None, name: str, frames: list[tuple[float, TaxelFrame]]) -> FramesLine:
    with without([rule] if rule else []):
        estimator = make_estimator(load().cell)
        reads = list(_read(estimator, name, frames))
    line = summed("", "", name, "", reads)
    return FramesLine(rule.name if rule else "", name, line.told, line.rmse, line.p95, line.covered, line.time)


def _read(estimator: Estimator, name: str, frames: list[tuple[float, TaxelFrame]]) -> Iterator[Read]:
    reader = copy(estimator)
    for theta, frame in frames:
        each = copy(estimator) if name.endswith("first frame") else reader
        yield read(each.estimate, theta, frame)
