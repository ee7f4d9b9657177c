"""Methods, scenes and speeds of the chart, as data."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from cell.commands.arguments import require_known
from cell.devices.assembly import Cell
from cell.lab.frontier.force import ForceSearch, insert_by_force
from cell.lab.frontier.hands import insert_with_exact_theta, insert_with_frozen_theta
from cell.lab.frontier.measure import Variant
from cell.lab.trials import Program, insert_peg
from cell.records.statistics import RateTest
from skills.contract import Request, SkillContext
from skills.flow import StageRecord

LONGEST = 120.0
"""Time after which a trial is stopped and lost, the same for every method, s from its start."""
SCALES = 1.0, 2.0, 0.5, 1.4, 2.8, 4.0, 0.7
"""Values of `speed_scale`, about a factor of the square root of 2 apart; in this order, so that an interrupted study shows whole curves."""
QUICK = (1.0,)
TEST = RateTest(good=0.05, bad=0.25, least=6)
"""Test that ends the trials of a point: clearly above 90 % or clearly below it."""


@dataclass(frozen=True, slots=True)
class Method:
    """One method: a program and its parameters."""

    colour: str
    program: Program = insert_peg
    preset: str | None = None
    sets: tuple[str, ...] = ()
    points: Mapping[str, str] | None = None
    """Further points at the method's own speed: a preset by its label."""


METHODS: Mapping[str, Method] = {
    "shipped": Method("#4477aa", points={"careful": "careful", "fast": "fast"}),
    "theta known exactly": Method("#228833", insert_with_exact_theta),
    "theta frozen after the grasp": Method("#ccbb44", insert_with_frozen_theta),
    "force alone": Method(
        "#ee6677", partial(insert_by_force, search=ForceSearch(speed=0.08, pitch=0.006, push=6.0, drop=0.0005))
    ),
    "printed": Method("#aa3377", preset="paper"),
}
"""Methods by name. The first three have the shipped parameters, the printed one those of `cell study paper`."""
SCENES: Mapping[str, tuple[str, ...]] = {
    "firm grip": (),
    "peg turns in the hand": ("grasp.force=15.0", "grip.friction=0.3"),
}
"""Keys of each scene, both with honest errors: the part of [gibbons], and the same in a grip that lets the peg turn by
tens of degrees, as [gibbons] reports.
"""


def timed(program: Program, cell: Cell, ctx: SkillContext) -> list[StageRecord]:
    """Run a program, and stop it after `LONGEST`."""
    until, request = cell.clock.now() + LONGEST, ctx.callbacks.poll
    ctx.callbacks = replace(ctx.callbacks, poll=lambda: Request.STOP if cell.clock.now() > until else request())
    return program(cell, ctx)


def family(method: str, scene: str) -> str:
    """Return the name of a curve."""
    return f"{method}, {scene}"


def variants(methods: Sequence[str], scenes: Sequence[str], scales: Sequence[float]) -> list[Variant]:
    """Return the points of the named methods in the named scenes; the order of speeds lets an interrupted study show every curve.

    Raises:
        ConfigError: A method or a scene does not exist.
    """
    for name in methods:
        require_known("--method", name, METHODS)
    for name in scenes:
        require_known("--scene", name, SCENES)
    pairs = [(method, scene) for scene in scenes for method in methods]
    found = [
        Variant(
            family(method, scene),
            f"{scale:g}",
            METHODS[method].preset,
            (*METHODS[method].sets, *SCENES[scene], f"speed_scale={scale:g}"),
            program=partial(timed, METHODS[method].program),
        )
        for scale in scales
        for method, scene in pairs
    ]
    return found + [
        Variant(family(method, scene), label, preset, SCENES[scene], program=partial(timed, METHODS[method].program))
        for method, scene in pairs
        for label, preset in (METHODS[method].points or {}).items()
    ]
