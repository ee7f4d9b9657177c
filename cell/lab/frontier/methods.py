"""Methods, scenes and speeds of the chart, from methods.toml."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from pkgutil import resolve_name

from cell.commands.arguments import require_known
from cell.devices.assembly import Cell
from cell.lab.compare import Variant
from cell.lab.rate_test import LevelTest
from cell.lab.trials import Program
from cell.lab.tune.measure import SECTIONS, Ranges, Space
from drivers.config_model import ConfigModel
from skills.contract import Request, SkillContext
from skills.flow import StageRecord

LONGEST = 120.0
"""Time from the start of a trial after which the trial is stopped and counts as lost, s, for every method."""
SCALES = 1.0, 2.0, 0.5, 1.4, 2.8, 4.0, 0.7
"""Values of `speed_scale`, about a factor of sqrt(2) apart. In this order, even an interrupted study shows points along the whole curve."""
QUICK = (1.0,)
TEST = LevelTest((0.5, 0.9), every=20)
"""Test that ends the trials of a point when its success is clearly above 90 %, between 50 and 90 %, or below 50 %."""


class Method(ConfigModel):
    """One method: a program and its parameters."""

    colour: str
    ranges: Ranges
    """Figures that `cell tune` changes."""
    program: str = "cell.lab.trials:insert_peg"
    preset: str | None = None
    tuned: Mapping[str, Mapping[str, float]] = {}
    """Tuned figures by scene; a scene without figures uses those of the first scene."""
    points: Mapping[str, str] = {}
    """Presets to mark, at the method's own speed, by the name on the chart."""

    def made(self, figures: Mapping[str, float]) -> Program:
        """Return the program with those of `figures` that are parameters of the program, stopped after `LONGEST`."""
        own = {name: value for name, value in figures.items() if "." not in name and name not in SECTIONS}
        return partial(timed, partial(resolve_name(self.program), **own))

    def space(self, scene: str, path: Path | None = None, sets: Sequence[str] = ()) -> Space:
        """Return the settings of the method in a scene."""
        return Space(path, [*sets, *SCENES[scene].sets], self.ranges, self.preset, self.made)

    def figures(self, scene: str) -> Mapping[str, float]:
        """Return the tuned figures for a scene; if there are none, those for the first scene, or an empty mapping."""
        return self.tuned.get(scene) or self.tuned.get(next(iter(SCENES))) or {}


class Scene(ConfigModel):
    """One scene, a column of a chart."""

    name: str
    chart: str = "frontier"
    """Name of the chart."""
    sets: Sequence[str] = ()
    """Keys of the config."""


_DATA = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
METHODS = {name: Method.model_validate(each) for name, each in _DATA["method"].items()}
SCENES = {scene.name: scene for scene in map(Scene.model_validate, _DATA["scene"])}


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
    """Return the points of the named methods in the named scenes, speed by speed, so that an interrupted study shows every curve.

    Raises:
        ConfigError: A method or a scene does not exist.
    """
    require_methods(methods, scenes)
    curves = []
    for scene, name in product(scenes, methods):
        method, own = METHODS[name], SCENES[scene].sets
        figures = method.figures(scene)
        tuned = (*own, *method.space(scene).sets(figures))
        curves.append((family(name, scene), method, own, tuned, method.made(figures)))
    return [
        Variant(curve, f"{scale:g}", method.preset, (*tuned, f"speed_scale={scale:g}"), program=program)
        for scale in scales
        for curve, method, _, tuned, program in curves
    ] + [
        Variant(curve, name, preset, tuple(own), program=method.made({}))
        for curve, method, own, _, _ in curves
        for name, preset in method.points.items()
    ]
