"""Methods, scenes and speeds of the chart, from methods.toml."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from cell.commands.arguments import require_known
from cell.devices.assembly import Cell
from cell.lab.compare import Variant
from cell.lab.rate_test import RateTest
from cell.lab.trials import Program
from cell.lab.tune.measure import SECTIONS, Ranges, Space
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
    ranges: Ranges
    """Figures that `cell tune` changes."""
    program: str = "cell.lab.trials:insert_peg"
    preset: str | None = None
    tuned: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Figures by scene; a scene without its own takes those of the first scene."""
    points: Mapping[str, str] = field(default_factory=dict)
    """Presets to mark, at the method's own speed, by the name on the chart."""

    def made(self, figures: Mapping[str, float]) -> Program:
        """Return the program with the figures that are its own parameters."""
        own = {name: value for name, value in figures.items() if "." not in name and name not in SECTIONS}
        return partial(timed, partial(resolve_name(self.program), **own))

    def space(self, scene: str, path: Path | None = None, sets: Sequence[str] = ()) -> Space:
        """Return the settings of the method in a scene."""
        return Space(path, [*sets, *SCENES[scene].sets], self.ranges, self.preset, self.made)

    def figures(self, scene: str) -> Mapping[str, float]:
        """Return the tuned setting for a scene; without one, that of the method as it was before."""
        return self.tuned.get(scene) or self.tuned.get(next(iter(SCENES))) or {}


@dataclass(frozen=True, slots=True)
class Scene:
    """One scene, a column of a chart."""

    chart: str = "frontier"
    """Name of the chart."""
    sets: Sequence[str] = ()
    """Keys of the config."""


def _read() -> tuple[dict[str, Method], dict[str, Scene]]:
    data: dict[str, Any] = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
    methods = {
        name: Method(
            **{**each, "ranges": {figure: (float(low), float(high)) for figure, (low, high) in each["ranges"].items()}}
        )
        for name, each in data["method"].items()
    }
    return methods, {each.pop("name"): Scene(**each) for each in data["scene"]}


METHODS, SCENES = _read()


def timed(program: Program, cell: Cell, ctx: SkillContext) -> list[StageRecord]:
    """Run a program, and stop it after `LONGEST`."""
    until, request = cell.clock.now() + LONGEST, ctx.callbacks.poll
    ctx.callbacks = replace(ctx.callbacks, poll=lambda: Request.STOP if cell.clock.now() > until else request())
    return program(cell, ctx)


def family(method: str, scene: str) -> str:
    """Return the name of a curve."""
    return f"{method}, {scene}"


def require_methods(methods: Sequence[str], scenes: Sequence[str]) -> None:
    """Raise ConfigError if a method or a scene does not exist."""
    for name in methods:
        require_known("--method", name, METHODS)
    for name in scenes:
        require_known("--scene", name, SCENES)


def variants(methods: Sequence[str], scenes: Sequence[str], scales: Sequence[float]) -> list[Variant]:
    """Return the points of the named methods in the named scenes; the order of speeds lets an interrupted study show every curve.

    Raises:
        ConfigError: A method or a scene does not exist.
    """
    require_methods(methods, scenes)
    pairs = [(method, scene) for scene in scenes for method in methods]
    settings = {
        (method, scene): METHODS[method].space(scene).sets(METHODS[method].figures(scene)) for method, scene in pairs
    }
    found = [
        Variant(
            family(method, scene),
            f"{scale:g}",
            METHODS[method].preset,
            (*SCENES[scene].sets, *settings[method, scene], f"speed_scale={scale:g}"),
            program=METHODS[method].made(METHODS[method].figures(scene)),
        )
        for scale in scales
        for method, scene in pairs
    ]
    return found + [
        Variant(family(method, scene), name, preset, tuple(SCENES[scene].sets), program=METHODS[method].made({}))
        for method, scene in pairs
        for name, preset in METHODS[method].points.items()
    ]
