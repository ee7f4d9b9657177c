"""The ladder of contact models, each measured on the same tasks: speed, accuracy and failures.

A rig pushes the cell's peg at five fixed tilts with 10 N into the cell's hole; sideways the peg is free. The study compares
the depth with the exact depth, computed from sections. A drag over solid plate reveals seams, and a peg 20 um too thick
must stay out. A map shows the limits of integration, measured and from theory. Models that fail stay in the table: the
verdict names each failure, for example `void` if bodies penetrate.
"""

import argparse
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle, product
from typing import Any

import numpy as np

from cell.commands.arguments import out_folder
from cell.film.drawing import COLOURS
from cell.lab import contact_rig as rig
from cell.lab.arguments import load_simulated
from cell.lab.charts import BLUE, GREEN, GREY, INK, RED, Curve, Panel, draw_panels
from cell.lab.hole_models import HoleModel
from cell.lab.report import StudyReport, reported
from cell.lab.section import exact_depth
from cell.lab.tables import Columns, table
from cell.lab.workers import each_of
from drivers.part.contract import Part
from sim.world import native
from sim.world.truth import VOID_PENETRATION, VOID_SHARE

SHIPPED = "closed form, 0.5 ms"
SHALLOW, STEEP = (1, 2, 5), (15, 45)
"""Tilts, degrees: of an almost upright peg (`SHALLOW`), and of a leaning peg that drops into the hole (`STEEP`)."""
PUSH, SECONDS = 10.0, 1.5
"""Force, N, and duration, s, of a push."""
AT_REST = 1e-2
"""Speed below which a pushed peg is at rest, m/s."""
EXACT_ENOUGH = 0.01
"""Largest relative error of the depth that a skill tolerates, fraction."""
MAP_SECONDS, MAP_TILT = 0.6, 5
TIMESTEPS, STIFFNESSES = np.geomspace(1e-4, 4e-3, 12), np.geomspace(1e4, 1e8, 17)
"""Time steps of the map's columns, s, and stiffnesses of its rows, 1/s²."""
HOLES = {"exact": "contacts begin before touch (shipped)", "unpredicted": "contacts begin at touch"}
"""Models of the hole on the map of integration."""
VERDICTS = {"holds": GREEN, "penetrates": COLOURS[4], "unstable": RED}
LOWEST, HIGHEST = 0.02, 1000.0
"""Ends of the axis of errors, %; a model through which the peg falls is drawn at the upper end."""


@dataclass(frozen=True, slots=True)
class Rung:
    """One model of contact on the ladder."""

    name: str
    family: str
    model: HoleModel
    timestep: float
    """Time step of the physics, s."""


def model(**changes: Any) -> HoleModel:
    """Return a model with these changes, without the lower bound of the contacts' time constant."""
    return HoleModel(contact_time=0.0, **changes)


def ladder(peg: Part) -> list[Rung]:
    """Return the rungs of the ladder that are possible for a peg: models of the hole at several time steps, and softer contacts."""
    kinds: list[tuple[str, str, HoleModel, tuple[float, ...]]] = [
        ("closed form", "closed form", model(), (2.5e-4, 5e-4, 1e-3, 2e-3)),
        ("unpredicted", "closed form, touching only", model(hole="unpredicted"), (2.5e-4, 5e-4, 1e-3, 2e-3)),
    ]
    for path, is_native in (("legacy", False), ("native", True)):
        for facets in (16, 32, 64):
            boxes = model(hole="boxes", facets=facets, native_ccd=is_native)
            kinds.append((f"{facets} boxes, {path}", f"ring of boxes, {path} CCD", boxes, (5e-4, 1e-3)))
    rungs = [Rung(f"{name}, {1e3 * dt:g} ms", family, how, dt) for name, family, how, steps in kinds for dt in steps]
    softer = [("closed form", 8.0, model(time_constant=8.0)), ("closed form", 40.0, model(time_constant=40.0))]
    softer += [("64 boxes, legacy", 40.0, model(hole="boxes", facets=64, time_constant=40.0))]
    rungs += [
        Rung(f"{name}, 0.5 ms, soft {steps:g} steps", "softer contacts", how, 5e-4) for name, steps, how in softer
    ]
    return [rung for rung in rungs if rung.model.has_hole_for(peg)]


def boundary_bound(timestep: float) -> float:
    """Return the stiffness k, 1/s², at which a permanently active contact becomes unstable, with critical damping b = 2 sqrt(k).

    MuJoCo's contact, [todorov], requires the acceleration -b v - k r; semi-implicit Euler gives v' = v - (b v + k r) dt
    and r' = r + v' dt. The eigenvalues leave the unit circle if k dt² + 2 b dt = 4: sqrt(k) dt = 2 (sqrt(2) - 1).
    """
    return (2.0 * (math.sqrt(2.0) - 1.0) / timestep) ** 2


def boundary_bouncing(timestep: float) -> float:
    """Return the stiffness k, 1/s², at which a contact that begins only at touch adds energy, with critical damping b = 2 sqrt(k).

    A body that arrives with the speed v is at most v dt deep at the first contact, and leaves with the speed
    (k dt² + b dt - 1) v. Both speeds are equal if k dt² + b dt = 2: sqrt(k) dt = sqrt(3) - 1.
    """
    return ((math.sqrt(3.0) - 1.0) / timestep) ** 2


@dataclass(frozen=True, slots=True)
class RungRow:
    """Result of one rung; a row of contact.csv."""

    name: str
    family: str
    timestep: float
    """Time step of the physics, s."""
    fault: str = ""
    """Reason why the rung has no measurement; empty if it has one."""
    real_time: float = math.nan
    """Speed of bare physics in multiples of real time, one core."""
    shallow_error: float = math.inf
    """Worst relative error of the depth at 1 to 5 degrees; infinite if the state is no longer finite."""
    steep_error: float = math.inf
    """Worst relative error of the depth at 15 and 45 degrees; infinite if the state is no longer finite."""
    penetration: float = math.inf
    """Deepest penetration that lasted longer than 2 ms, m."""
    is_void: bool = True
    rests: bool = False
    drag: float = math.inf
    """Peak-to-peak lateral force over solid plate, N."""
    keeps_out: bool = False
    """True if the too thick peg stays out."""

    @property
    def error(self) -> float:
        """Return the worst relative error of the depth."""
        return max(self.shallow_error, self.steep_error)


def verdict(row: RungRow) -> str:
    """Return the verdict on a rung in words."""
    if row.fault:
        return row.fault
    wrong = []
    if not math.isfinite(row.error):
        wrong.append("not finite")
    elif row.error > EXACT_ENOUGH:
        wrong.append("wrong depth")
    if row.is_void:
        wrong.append("void")
    if not row.rests:
        wrong.append("does not rest")
    # Peak-to-peak lateral force over solid plate that a search tolerates, N.
    if row.drag > 3.0:
        wrong.append("seams")
    if not row.keeps_out:
        wrong.append("lets a thick peg in")
    return ", ".join(wrong) or "good"


@dataclass(frozen=True, slots=True)
class MapRow:
    """One point of the map; a row of integration.csv."""

    hole: str
    timestep: float
    """Time step of the physics, s."""
    stiffness: float
    """Stiffness of the contact, 1/s², with critical damping."""
    verdict: str
    """`holds`, `penetrates` or `unstable`."""


def size(part: Part) -> str:
    """Return the size of a part in words: its extents, or a single extent if every rotation leaves it the same."""
    along, across = (f"{2e3 * half:g}" for half in part.half)
    return f"{along} x {across} mm" if part.symmetry > 0.0 else f"{along} mm"


def measure_rung(rung: Rung, azimuths: Sequence[float], peg: Part, hole: Part) -> RungRow:
    """Measure one rung on a peg and its hole; if the model raises an error, the row gives it as fault."""
    try:
        with native.quiet():
            return _measure_rung(rung, azimuths, peg, hole)
    except Exception as error:  # any failure of a model is a row of the ladder, not the end of the study
        return RungRow(rung.name, rung.family, rung.timestep, f"{type(error).__name__}: {error}")


def _measure_rung(rung: Rung, azimuths: Sequence[float], peg: Part, hole: Part) -> RungRow:
    pushes: list[tuple[int, float, rig.Pushed]] = []  # tilt, degrees; relative error of the depth; result
    spent = 0.0  # core time of the pushes without meters, s
    for degrees, azimuth in product((*SHALLOW, *STEEP), azimuths):
        tilt = math.radians(degrees)
        place = (peg, tilt, azimuth, PUSH, SECONDS)
        pushed = rig.push(rig.tilted_peg(peg, hole, tilt, azimuth, 0.0, rung.timestep, rung.model), *place)
        bare = rig.tilted_peg(peg, hole, tilt, azimuth, 0.0, rung.timestep, rung.model, is_judged=False)
        started = time.thread_time()
        rig.push(bare, *place)
        spent += time.thread_time() - started
        error = abs(pushed.depth / exact_depth(peg, hole, rig.attitude(tilt, azimuth)) - 1.0)
        pushes.append((degrees, error if math.isfinite(error) else math.inf, pushed))
    penetration = max(pushed.penetration for _, _, pushed in pushes)
    return RungRow(
        name=rung.name,
        family=rung.family,
        timestep=rung.timestep,
        real_time=len(pushes) * SECONDS / spent,
        shallow_error=max(error for degrees, error, _ in pushes if degrees in SHALLOW),
        steep_error=max(error for degrees, error, _ in pushes if degrees in STEEP),
        penetration=penetration,
        is_void=penetration > min(VOID_PENETRATION, VOID_SHARE * peg.clearance(hole)),
        rests=all(pushed.speed < AT_REST for _, _, pushed in pushes),
        drag=_seams(rung, peg, hole),
        keeps_out=_keeps_out(rung, hole),
    )


def _seams(rung: Rung, peg: Part, hole: Part) -> float:
    """Return the largest peak-to-peak lateral force over solid plate, N."""
    seams, tilt = 0.0, math.pi / 4
    for direction in (0.4, 1.9):
        over = rig.tilted_peg(peg, hole, tilt, 0.0, 0.0, rung.timestep, rung.model, is_judged=False)
        # Distance between a dragged peg's edge path and the hole's rim, m.
        swing = rig.drag(over, peg, tilt, direction, hole.reach + 2.45e-3)
        seams = max(seams, swing if math.isfinite(swing) else math.inf)
    return seams


def _keeps_out(rung: Rung, hole: Part) -> bool:
    """Return True if a peg thicker than the hole goes no deeper than its tilt allows."""
    # Excess of the too thick peg over the hole on every side, m.
    thick, azimuth = hole.grown(1e-5), 0.3
    for degrees in (1, 5):
        tilt = math.radians(degrees)
        over = rig.tilted_peg(thick, hole, tilt, azimuth, 0.2, rung.timestep, rung.model)
        depth = rig.push(over, thick, tilt, azimuth, PUSH, SECONDS).depth
        if not depth <= 1.01 * exact_depth(thick, hole, rig.attitude(tilt, azimuth)) + VOID_PENETRATION:
            return False
    return True


def measure_point(kind: str, timestep: float, stiffness: float, peg: Part, hole: Part) -> MapRow:
    """Measure one point of the map of integration, with the model of the hole named by `kind`."""
    tilt, azimuth = math.radians(MAP_TILT), 0.3
    exact = exact_depth(peg, hole, rig.attitude(tilt, azimuth))
    with native.quiet():
        over = rig.tilted_peg(peg, hole, tilt, azimuth, 0.0, timestep, model(hole=kind, stiffness=stiffness))
        pushed = rig.push(over, peg, tilt, azimuth, PUSH, MAP_SECONDS)
    error = abs(pushed.depth / exact - 1.0)
    if not (math.isfinite(error) and pushed.speed < AT_REST and error < 0.5):
        verdict = "unstable"
    elif pushed.penetration > VOID_PENETRATION or error > EXACT_ENOUGH:
        verdict = "penetrates"
    else:
        verdict = "holds"
    return MapRow(kind, timestep, stiffness, verdict)


def ladder_panel(rows: Sequence[RungRow], parts: str) -> Panel:
    """Return the panel of error against speed, a colour per family; failing models are hollow, the shipped one has a ring."""
    families = list(dict.fromkeys(row.family for row in rows))
    colours = dict(zip(families, cycle((*COLOURS[1:], GREY)), strict=False))
    groups: dict[tuple[str, bool], list[RungRow]] = {}
    for row in rows:
        if math.isfinite(row.real_time):
            groups.setdefault((row.family, verdict(row) == "good"), []).append(row)
    curves = [
        _rungs(of, colours[family], f"{family}, {'good' if is_good else 'fails a gate'}", 1.8, not is_good)
        for (family, is_good), of in groups.items()
    ]
    curves.append(_rungs([row for row in rows if row.name == SHIPPED], INK, "shipped", 3.5, True))
    return Panel(
        f"{parts}, 10 N, rigid mover; {len(rows)} models",
        "bare physics, multiples of real time on one core",
        "worst error to the exact depth over 1, 2, 5, 15, 45 degrees (%)",
        curves,
        "xy",
        (10, 20, 50, 100, 200, 500),
        (0.1, 1, 10, 100, 1000),
        y_limits=(LOWEST / 1.4, 1.6 * HIGHEST),
    )


def _rungs(rows: Sequence[RungRow], colour: str, label: str, size: float, is_hollow: bool) -> Curve:
    errors = [min(max(100 * row.error, LOWEST), HIGHEST) for row in rows]
    return Curve([row.real_time for row in rows], errors, colour, label, "o", size, is_hollow=is_hollow)


def map_panels(rows: Sequence[MapRow]) -> list[Panel]:
    """Return a panel for each model of `HOLES`: results of integration by step and stiffness, with theoretical limits."""
    return [_map_panel([row for row in rows if row.hole == hole], title) for hole, title in HOLES.items()]


def _map_panel(rows: Sequence[MapRow], title: str) -> Panel:
    curves = []
    for name, colour in VERDICTS.items():
        of = [row for row in rows if row.verdict == name]
        x, y = [1e3 * row.timestep for row in of], [row.stiffness for row in of]
        curves.append(Curve(x, y, colour, name, "s", 1.5, 0.6))
    steps, stiffnesses = [row.timestep for row in rows], [row.stiffness for row in rows]
    fine = np.geomspace(min(steps), max(steps), 100)
    for law, label, style in LAWS:
        curves.append(Curve(1e3 * fine, [law(step) for step in fine], INK, label, style))
    curves.append(Curve(1e3 * fine, 1.0 / (2.0 * fine) ** 2, BLUE, "stiffest standard form: 2 steps", ":"))
    labels = "time step (ms)", "stiffness of the contact, k (1/s²), with b = 2 sqrt(k)"
    limits = min(stiffnesses) / 2, 2 * max(stiffnesses)
    return Panel(f"{title}; n = {len(rows)} points", *labels, curves, "xy", y_limits=limits)


LAWS = (
    (boundary_bound, "theory, bound: k dt² + 2 b dt = 4", "-"),
    (boundary_bouncing, "theory, bouncing: k dt² + b dt = 2", "--"),
)
"""Theoretical limits of the stiffness, each with label and line style."""


def run(args: argparse.Namespace) -> StudyReport:
    """Measure every rung and the map, write the tables, draw the charts."""
    config, folder = load_simulated(args).cell, out_folder(args.out)
    peg, hole = config.peg.part, config.hole.part
    parts = f"{size(peg)} in {size(hole)}"
    # Azimuths of the tilt, rad.
    rungs = each_of(measure_rung, [(rung, (0.3,), peg, hole) for rung in ladder(peg)], args.workers, "models")
    places = [(kind, float(dt), float(k), peg, hole) for kind in HOLES for dt in TIMESTEPS for k in STIFFNESSES]
    points = each_of(measure_point, places, args.workers, "points")
    title = "Models of the contact: speed against exactness"
    failing = f"Where integration fails: {parts}, at 5 degrees, pushed with 10 N"
    charts = [
        draw_panels([ladder_panel(rungs, parts)], title, folder / "contact.png"),
        draw_panels(map_panels(points), failing, folder / "integration.png", legend=3),
    ]
    columns: Columns = {
        "x real time": lambda row: f"{row.real_time:.0f}",
        "error 1-5 deg": lambda row: f"{100 * row.shallow_error:.2f} %",
        "15-45 deg": lambda row: f"{100 * row.steep_error:.2f} %",
        "penetration": lambda row: f"{1e6 * row.penetration:.1f} um",
        "drag": lambda row: f"{row.drag:.2g} N",
        "verdict": verdict,
    }
    order = sorted(rungs, key=lambda row: row.error)
    title = "Models of the hole: bare physics, rigid mover"
    shown = table(title, {"model of the hole": lambda row: row.name}, columns, order)
    return reported(shown, folder, {"contact.csv": rungs, "integration.csv": points}, charts, rungs=rungs)
