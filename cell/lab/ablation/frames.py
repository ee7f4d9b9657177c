"""Error of theta on single frames, with the whole estimator and without each of its rules; `cell study tactile` uses the same frames."""

from collections.abc import Callable, Iterator
from dataclasses import replace

from cell.config.load import load
from cell.devices.assembly import make_estimator
from cell.lab.ablation.rules import RULES, SCENES
from cell.lab.ablation.switch import Rule, without
from cell.lab.tactile import CONDITIONS, Condition, Model, TactileLine, kinds, made, reads_of, summed
from drivers.quantities import TaxelFrame

NOMINAL = CONDITIONS[0]
OTHER_LENGTH = Condition("end 4 mm off", reach_back=(0.011, 0.019))
"""Pegs whose back end, between the pads, is up to 4 mm from its stated position."""
STUCK = 8000.0
"""Reading of a single wrong taxel, counts; a peg reads up to twice as much."""


def measure(count: int, done: Callable[[int], None]) -> list[TactileLine]:
    """Return the errors of `count` frames of each kind, with all rules of the estimator and without each rule in turn."""
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
    # In these scenes the law of the pads differs from that of the templates; the study tests them with nominal frames only.
    for law in ("hertz", "foam"):
        yield law, _made(law, "springs", NOMINAL, count)
    yield (
        "one wrong taxel",
        [(theta, _spoilt(frame, n)) for n, (theta, frame) in enumerate(_made("honest", "springs", NOMINAL, count))],
    )


def _made(scene: str, model: Model, condition: Condition, count: int) -> list[tuple[float, TaxelFrame]]:
    return list(made(load(sets=SCENES[scene]).cell, model, condition, count))


def _spoilt(frame: TaxelFrame, number: int) -> TaxelFrame:
    """Return the frame with the reading `STUCK` in one taxel, which differs for each `number`."""
    values = frame.values.copy()
    values.flat[number % values.size] = STUCK
    return replace(frame, values=values)


def _line(rule: Rule | None, name: str, frames: list[tuple[float, TaxelFrame]]) -> TactileLine:
    with without([rule] if rule else []):
        reads = reads_of(make_estimator(load().cell), frames, name.endswith("first frame"))
    return summed("", "", name, f"without {rule.name}" if rule else "all rules", reads)
