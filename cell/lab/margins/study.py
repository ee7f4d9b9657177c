"""`cell study margins`: the level of each error at which a method falls to 90 % and to 50 % success, by bisection.

The first level of an error is the honest one: for an error of config/reality.toml, its size there. The study assumes that
success falls monotonically with the level. A sequential test ends the trials of a level when the answer is clear. The same
seeds run at every level.
"""

import argparse
import json
import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import numpy as np

from cell.commands.arguments import out_folder, require_known
from cell.config.files import ERRORS_FILE, SHIPPED
from cell.lab.arguments import advancing, load_simulated, seeds_of
from cell.lab.charts import Curve, Panel, draw_panels
from cell.lab.frontier.methods import METHODS, SCENES, require_methods
from cell.lab.rate_test import RateTest, Verdict
from cell.lab.report import StudyReport, reported
from cell.lab.rows import successes, write_rows
from cell.lab.tables import Columns, table
from cell.lab.trials import Program, run_trials
from drivers.config_model import ConfigModel
from drivers.errors import ConfigError
from drivers.quantities import Vector
from sim.world.reality import AnyError, read

TESTS = {0.9: RateTest(good=0.05, bad=0.25, least=6), 0.5: RateTest(good=0.35, bad=0.65, least=6)}
"""Sequential test of a level, by the share of successes in question."""
SCENE = next(iter(SCENES))
TABLE = "margins.csv"


class Swept(ConfigModel):
    """One error of errors.toml."""

    name: str
    unit: str = "times"
    # By default a level is the width of a distribution divided by the honest width.
    levels: tuple[float, ...] = (1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0, 11.0, 16.0)
    """Levels from the honest to the hardest one."""
    key: str = ""
    """Setting of the config, `KEY=VALUE` with {level} in the value."""
    error: str = ""
    """Error of config/reality.toml to make wider."""
    program: str = ""
    """Program of the trials, MODULE:NAME, which receives the method's program and the level."""
    offset: float = 0.0
    factor: float = 1.0
    """Value = offset + factor · level, in SI units."""
    is_constant: bool = False
    """True if `error` is a constant with the value of the level in every trial, instead of a wider distribution."""

    def sets(self, level: float, errors: Mapping[str, AnyError]) -> tuple[str, ...]:
        """Return the keys of the config at a level."""
        value = self.offset + self.factor * level
        if not self.error:
            return (self.key.replace("{level}", f"{value:.6g}"),) if self.key else ()
        if self.is_constant:
            constant = {"distribution": "uniform", "low": value, "high": value, "basis": "assumed"}
            figures = constant | {"about": self.name, "unit": self.unit, "source": "Constant in this study"}
        else:
            figures = wider(errors[self.error], level)
        table = ", ".join(f"{key}={json.dumps(entry, ensure_ascii=False)}" for key, entry in figures.items())
        return (f"reality.errors.{self.error}={{{table}}}",)

    def made(self, program: Program, level: float) -> Program:
        """Return a method's program with this error."""
        return partial(resolve_name(self.program), program, self.factor * level) if self.program else program


def wider(error: AnyError, times: float) -> dict[str, Any]:
    """Return the data of an error with a distribution `times` as wide, with the same effect as `reality.scale`."""
    data = error.model_dump()
    for key, power in (("sigma", False), ("low", False), ("high", False), ("spread", True), ("values", True)):
        if key in data:
            value = np.asarray(data[key], dtype=float)
            data[key] = (value**times if power else value * times).tolist()
    if "probability" in data:
        data["probability"] = min(data["probability"] * times, 1.0)
    return data


def size_of(error: AnyError, times: float) -> str:
    """Return the size of an error with a distribution `times` as wide: its bounds, or three standard deviations."""
    data = wider(error, times)
    if "sigma" in data:
        return f"±{_told(3.0 * np.asarray(data['sigma']))} {error.unit}"
    if "low" in data:
        return f"{_told(np.asarray(data['low']))} to {_told(np.asarray(data['high']))} {error.unit}"
    if "spread" in data:
        return f"x 1/{_told(np.asarray(data['spread']))} to {_told(np.asarray(data['spread']))}"
    return f"{100.0 * data['probability']:.3g} %" if "probability" in data else f"x {times:g}"


def _told(figures: Vector) -> str:
    values = np.unique(figures)
    return f"{values[0]:.3g}" if len(values) == 1 else f"{values[0]:.3g}..{values[-1]:.3g}"


def boundary(holds: Callable[[int], bool], count: int) -> tuple[int, int]:
    """Return the index of the last level that holds, or -1, and that of the first level that fails, or `count`.

    The hardest level is tested first; then the boundary is bisected.

    Args:
        holds: Function that returns True if the level with an index, 0 for the honest one, holds.
        count: Number of levels.
    """
    last, first, number = -1, count, count - 1
    while first - last > 1:
        last, first = (number, first) if holds(number) else (last, number)
        number = (last + first) // 2
    return last, first


SWEPT = {
    swept.name: swept
    for swept in map(
        Swept.model_validate,
        tomllib.loads(Path(__file__).with_name("errors.toml").read_text(encoding="utf-8"))["error"],
    )
}
"""Errors of errors.toml by name."""


@dataclass(frozen=True, slots=True)
class ErrorMargin:
    """Levels of one error between which the success of one method falls to a share; NaN for a missing level."""

    method: str
    error: str
    share: float
    holds: float
    """Hardest level with at least this share of successes; NaN if the honest level has fewer."""
    fails: float
    """Next harder level, which has fewer successes; NaN if every level holds."""
    margin: float
    """`holds` divided by the honest level, or the inverse if harder levels are smaller, >= 1; 0 if no level holds."""
    size: str
    """Size of the error at `holds`, in words."""
    seen: str
    """Successes and trials at both levels, in words."""


class Levels:
    """Trials of one method at the levels of one error, in folders that a repeated call reuses."""

    def __init__(self, args: argparse.Namespace, seeds: range, method: str, swept: Swept) -> None:
        """Run nothing yet."""
        self._args, self._seeds, self._name, self._swept = args, seeds, method, swept
        self._method, self._errors = METHODS[method], read(SHIPPED / ERRORS_FILE).errors
        self._figures = {} if method == next(iter(METHODS)) else self._method.figures(SCENE)
        self._folder = out_folder(args.out) / method.replace(" ", "-") / swept.name.replace(" ", "-")
        self._counts: dict[int, str] = {}

    def margin(self, share: float) -> ErrorMargin:
        """Return the levels between which success falls to `share`, fraction; run the trials of the tested levels."""
        levels = self._swept.levels
        last, first = boundary(lambda number: self._holds(number, share), len(levels))
        holds = levels[last] if last >= 0 else math.nan
        seen = {number: self._counts[number] for number in (last, first) if number in self._counts}
        return ErrorMargin(
            self._name,
            self._swept.name,
            share,
            holds,
            levels[first] if first < len(levels) else math.nan,
            max(holds / levels[0], levels[0] / holds) if last >= 0 else 0.0,
            self._size(holds) if last >= 0 else "",
            ", ".join(f"{count} at {levels[number]:g}" for number, count in seen.items()),
        )

    def _size(self, level: float) -> str:
        swept = self._swept
        is_wider = swept.error and not swept.is_constant
        return size_of(self._errors[swept.error], level) if is_wider else f"{level:g} {swept.unit}"

    def _holds(self, number: int, share: float) -> bool:
        level, test = self._swept.levels[number], TESTS[share]
        space = self._method.space(SCENE, self._args.config, self._args.set)

        try:
            rows = run_trials(
                space.config((*space.sets(self._figures), *self._swept.sets(level, self._errors))),
                self._seeds,
                self._args.workers,
                self._folder / f"{level:g}",
                lambda row: None,
                is_enough=test.is_answered,
                program=self._swept.made(self._method.made(self._figures), level),
            )
        except ConfigError:  # the config, or an error drawn for a trial, is beyond the limits of cell or stand-in
            self._counts[number] = "refused"
            return False
        good, verdict = len(successes(rows)), test.of(rows)
        self._counts[number] = f"{good}/{len(rows)}"
        return good >= share * len(rows) if verdict is Verdict.OPEN else verdict is Verdict.GOOD


def draw(margins: Sequence[ErrorMargin], title: str, path: Path) -> Path:
    """Draw the margin of each error as a bar for 90 % success and a ring for 50 %, the smallest at the top; return the file."""
    at = {(line.method, line.error, line.share): line for line in margins}
    methods = list(dict.fromkeys(line.method for line in margins))
    order = sorted({line.error for line in margins}, key=lambda error: -at[methods[0], error, 0.9].margin)
    height, curves = 0.8 / len(methods), []
    for number, method in enumerate(methods):
        colour = METHODS[method].colour
        curves.append(Curve([], [], colour, method, "o"))
        for row, error in enumerate(order):
            place = row + 0.4 - height * (number + 0.5)
            line, half = at[method, error, 0.9], at[method, error, 0.5]
            is_open = bool(line.margin) and math.isnan(line.fails)
            bar = [0.97, max(line.margin, 1.0)], [place, place]
            curves.append(Curve(*bar, colour, "", "-", 15.0 * height, 0.85))
            curves.append(Curve([line.margin * 1.04] if is_open else [], [place] if is_open else [], colour, "", ">"))
            if half.margin > line.margin:
                curves.append(Curve([half.margin], [place], colour, "", "o", is_hollow=True))
    panel = Panel(
        "",
        "hardest level with 90 % success over the honest level (ring: with 50 %; arrow: range ends first)",
        "",
        curves,
        "x",
        x_ticks=(1, 1.4, 2, 3, 4, 6, 8, 12, 16),
        y_ticks=range(len(order)),
        y_names=order,
    )
    return draw_panels([panel], title, path, height=0.5 + 0.36 * len(order), width=9.0)


def run(args: argparse.Namespace) -> StudyReport:
    """Find every margin, write the table after each, and draw the chart.

    Raises:
        ConfigError: A method or an error is unknown.
    """
    load_simulated(args)
    for name in args.error:
        require_known("--error", name, SWEPT)
    methods = args.method or [*METHODS]
    require_methods(methods, ())
    seeds = seeds_of(args, 24, quick=6)
    names, folder = args.error or [*SWEPT][: 1 if args.quick else None], out_folder(args.out)
    found: list[ErrorMargin] = []
    with advancing("margins", len(methods) * len(names)) as done:
        for method, name in product(methods, names):
            found += map(Levels(args, seeds, method, SWEPT[name]).margin, TESTS)
            write_rows(found, folder / TABLE)
            done(1)
    title = (
        f"Margins of each error, at most {len(seeds)} trials a level, seeds from {seeds[0]}; all other errors honest"
    )
    columns: Columns = {
        "success": lambda line: f"{100 * line.share:.0f} %",
        "holds": lambda line: line.size or "not at the honest level",
        "margin": lambda line: f"{'> ' if math.isnan(line.fails) else ''}{line.margin:.3g}",
        "trials": lambda line: line.seen,
    }
    shown = table(title, {"method": lambda line: line.method, "error": lambda line: line.error}, columns, found)
    return reported(
        shown, folder, {TABLE: found}, [draw(found, title, folder / "margins.png")], title=title, margins=found
    )
