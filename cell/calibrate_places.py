"""Places of plate and rack, touched off with pegs from the rack: height and tilt of the plate, place of the slots, length of the pegs.

Everything is told as this arm sees it, from its own joints. One touch tells how high the plate is by a peg of the stated length: with
several pegs the mean is taken for the plate's, and the differences for the pegs'.
"""

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import numpy as np

from cell.assembly import Cell, assemble, opened
from cell.cell_config import CellConfig
from cell.statistics import student
from drivers.errors import CellError, NotCalibratedError
from drivers.figures_file import write_whole
from drivers.frames import end_point
from drivers.parts import PLATE_BORDER, Hole
from drivers.quantities import Pose, Vector
from skills.catalogue import GRASP, RECOVER
from skills.contract import Interrupted, Observation, Outcome, SkillContext
from skills.touch_off import touch_off

PEGS = 3
"""Number of pegs that are taken, one slot after the other."""
MOST_FORCE = 25.0
"""Largest force at the TCP while a peg touches, N; beyond it the calibration ends."""
STILL = 1e-3
"""Height by which the hand has risen when it is no longer at the slot, m."""
REPEATED = 1e-4
"""Repeatability of the arm, m, standard deviation: its maker's 0.1 mm."""
MOST_HEIGHT = 0.01
"""Largest difference between the plate's height and the stated one that is believed, m."""
MOST_TILT = 0.05
"""Largest tilt of the plate that is believed, rad."""
MOST_UNEVEN = 1e-3
"""Largest distance of a touched point from the plane through all, m."""
MOST_RACK = 5e-3
"""Largest difference between the rack's place and the stated one that is believed, m."""


@dataclass(frozen=True, slots=True, eq=False)
class PegTouches:
    """Measurements that were made with one peg."""

    slot: Vector
    """Middle of the slot's mouth less the stated one, along x and y, shape (2,), m."""
    points: Vector
    """Places that the peg touched, by the stated length, shape (n, 3), m, base frame."""


@dataclass(frozen=True, slots=True)
class Places:
    """What the pegs told together; lengths in m, each with half the width of its 95 % interval where that is asked for."""

    date: date
    unit: str
    height: float
    """Height of the plate in the middle of the hole's area, base frame, by pegs of the stated length in the mean."""
    height_interval: float
    lean: tuple[tuple[float, float], ...]
    """Slopes of the plate along x and y under each peg, rad: each finds another workpiece where the line exchanges them."""
    uneven: float
    """Largest root mean square distance of a peg's points from their plane."""
    pegs: tuple[float, ...]
    """Length by which each peg reached further than the pegs did in the mean."""
    rack: tuple[float, float]
    """Place of the rack less the stated one, along x and y."""
    rack_interval: tuple[float, float]
    centre: tuple[float, float, float]
    """Place of the plate as `hole.centre` would have it."""
    first: tuple[float, float, float]
    """Place of the rack as `rack.first` would have it."""
    is_plate_elsewhere: bool
    """Whether the stated height lies outside of the interval, so that the file is to be changed."""
    is_rack_elsewhere: bool
    """Whether the stated place of the rack lies outside of an interval, so that the file is to be changed."""

    @property
    def tilt(self) -> float:
        """Largest tilt of the plate that a peg found, rad."""
        return max(math.hypot(*each) for each in self.lean)

    @property
    def sections(self) -> str:
        """What to write in the cell's file; empty where all is as it is stated, as far as the pegs can tell."""
        return "\n".join(
            [f"[hole]\ncentre = {point(self.centre)}\n"] * self.is_plate_elsewhere
            + [f"[rack]\nfirst = {point(self.first)}\n"] * self.is_rack_elsewhere
        )

    def write(self, path: Path) -> None:
        """Write a file whole or not at all.

        Raises:
            ConfigError: The file cannot be written; one that was there before stays.
        """
        head = (
            f"# Touched off by `cell calibrate places` on {self.date}, arm {self.unit}; for the cell's file. SI units.\n"
            f"# Plate: height ± {self.height_interval:.2g}, tilt up to {self.tilt:.2g}, uneven by {self.uneven:.2g}.\n"
            f"# Rack: ± {self.rack_interval[0]:.2g} and ± {self.rack_interval[1]:.2g} along x and y; its height is taken as stated.\n"
            f"# Pegs, further out of the hand than in the mean: {', '.join(f'{x:.2g}' for x in self.pegs)}.\n"
        )
        write_whole(path, head + self.sections, "places")


def calibrate_places(config: CellConfig, today: date, done: Callable[[int, int], None], pegs: int = PEGS) -> Places:
    """Take pegs from the rack, touch the plate with each, and return the measured places; the arm is brought to rest first.

    Args:
        config: Config of the cell.
        today: Date of the calibration.
        done: Called with the number of touches done and the number of all.
        pegs: Number of pegs to take, from the first slot on, at least 2.

    Raises:
        NotCalibratedError: No peg, nothing to touch, too much force, or places that are none.
        CellError: A device cannot be opened, is silent or stopped, or does not do what it is told.
    """
    if config.is_simulated and config.sim is not None:
        config = config.model_copy(update={"sim": config.sim.model_copy(update={"pace": "max"})})
    with opened(assemble(config)) as cell:
        return measured_places(cell, today, done, pegs)


def measured_places(cell: Cell, today: date, done: Callable[[int, int], None], pegs: int = PEGS) -> Places:
    """Do what `calibrate_places` does with a cell that is open."""
    config, ctx = cell.config, cell.context(0)
    ctx.limits = config.limits.model_copy(update={"force": min(config.limits.force, MOST_FORCE)})
    ctx.stage = "calibrate places"
    try:
        if ctx.observe().gripper.is_gripping:
            raise NotCalibratedError("calibrate places: the hand holds something; `cell run recover` first")
        touched = [_touches(cell, ctx, slot, pegs, done) for slot in range(pegs)]
    except Interrupted as interruption:
        raise NotCalibratedError(
            f"calibrate places: {interruption.reason.name} at {ctx.limits.force:g} N allowed; see what the hand touched"
            " and where the peg is, then `cell run recover`"
        ) from None
    finally:
        with suppress(CellError):
            ctx.rest.wait(ctx.clock, ctx.scan_period)
    found = places_of(touched, config, today)
    if (why := implausible(found, config)) is not None:
        raise NotCalibratedError(f"calibrate places: {why}")
    return found


def corners(hole: Hole) -> list[Vector]:
    """Return places round the area that contains the hole, on solid plate, each shape (3,), m, base frame."""
    middle, (x, y) = np.array(hole.centre), (0.5 * extent + 0.5 * PLATE_BORDER for extent in hole.area)
    return [middle + np.array([sx * x, sy * y, 0.0]) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


def _touches(cell: Cell, ctx: SkillContext, slot: int, pegs: int, done: Callable[[int, int], None]) -> PegTouches:
    """Take the peg of a slot, touch the plate at every corner, and drop the peg into the bin."""
    config, places = cell.config, corners(cell.config.hole)
    ctx.job = config.job(slot=slot)
    cell.restock(ctx.job, config.first_seed + slot)
    closed: list[Pose] = []

    def watch(seen: Observation, _: object) -> None:
        if seen.gripper.is_gripping and (not closed or seen.arm.tcp.position[2] < closed[0].position[2] + STILL):
            closed.append(seen.arm.tcp)

    ctx.record = watch
    (grasped,) = GRASP.run(config.skill_set(), ctx)
    ctx.record = lambda seen, setpoint: None
    if grasped.result.outcome is not Outcome.SUCCESS or not closed:
        raise NotCalibratedError(
            f"calibrate places: no peg from slot {slot % config.rack.slots + 1}: {grasped.result.reason.name}"
        )
    held = ctx.observe().peg
    points = []
    for number, place in enumerate(places, 1):
        found = touch_off(place, config.params(GRASP).transfer, ctx)
        if found is None:
            raise NotCalibratedError(
                f"calibrate places: nothing to touch at x = {place[0]:.3f}, y = {place[1]:.3f} m; see hole.centre and hole.area"
            )
        points.append(found)
        done(slot * len(places) + number, pegs * len(places))
    slot_at = mouth(closed[-1], held.theta, held.offset, config)
    x, y, _ = config.rack.first
    stated = np.array([x, y + config.rack.pitch * (slot % config.rack.slots)])
    (dropped,) = RECOVER.run(config.skill_set(), ctx)
    if dropped.result.outcome is not Outcome.SUCCESS:
        raise NotCalibratedError(f"calibrate places: the peg did not go to the bin: {dropped.result.reason.name}")
    return PegTouches(slot_at - stated, np.array(points))


def mouth(hand: Pose, theta: float, offset: float, config: CellConfig) -> Vector:
    """Return the middle of the mouth of the slot that a peg stood in when the hand closed, along x and y, shape (2,), m."""
    tip, axis = end_point(hand, theta, config.peg.length)
    across: Vector = tip + config.rack.depth * axis + offset * hand.rotation[:, 1]
    return across[:2]


def places_of(touched: Sequence[PegTouches], config: CellConfig, today: date) -> Places:
    """Return what pegs told together: each the plane of its plate."""
    middle = np.array(config.hole.centre)
    planes = [plane_through(each.points - middle) for each in touched]
    heights = middle[2] + np.array([values[2] for values, _ in planes])
    height = float(heights.mean())
    quantile = student(len(touched) - 1)
    slots = np.array([each.slot for each in touched])
    apart = quantile * np.hypot(slots.std(axis=0, ddof=1), REPEATED) / math.sqrt(len(touched))
    rack = slots.mean(axis=0)
    sure = quantile * math.hypot(float(heights.std(ddof=1)), REPEATED) / math.sqrt(len(touched))
    first = (config.rack.first[0] + float(rack[0]), config.rack.first[1] + float(rack[1]), config.rack.first[2])
    return Places(
        date=today,
        unit=config.arm_unit(),
        height=height,
        height_interval=sure,
        lean=tuple((float(values[0]), float(values[1])) for values, _ in planes),
        uneven=max(rms for _, rms in planes),
        # A peg that reaches further touches with the hand higher up, and by the stated length the plate seems higher.
        pegs=tuple(float(x) for x in heights - height),
        rack=(float(rack[0]), float(rack[1])),
        rack_interval=(float(apart[0]), float(apart[1])),
        centre=(config.hole.centre[0], config.hole.centre[1], height),
        first=first,
        is_plate_elsewhere=abs(height - config.hole.centre[2]) > sure,
        is_rack_elsewhere=bool(np.any(np.abs(rack) > apart)),
    )


def plane_through(points: Vector) -> tuple[Vector, float]:
    """Return slopes along x and y and height of the plane through points, shape (n, 3), m, and their distance from it, rms, m."""
    rows = np.column_stack([points[:, :2], np.ones(len(points))])
    values, *_ = np.linalg.lstsq(rows, points[:, 2], rcond=None)
    return np.asarray(values), float(np.sqrt(np.mean((points[:, 2] - rows @ values) ** 2)))


def implausible(found: Places, config: CellConfig) -> str | None:
    """Return in words what no plate or rack can have; None where all is plausible."""
    checks = (
        ("plate: height off by", found.height - config.hole.centre[2], MOST_HEIGHT, "m", "see hole.centre"),
        ("plate: tilt", found.tilt, MOST_TILT, "rad", "see how the plate stands"),
        (
            "plate: uneven by",
            found.uneven,
            MOST_UNEVEN,
            "m",
            "see what lies on it, and whether the peg slips in the hand",
        ),
        ("rack: off along x by", found.rack[0], MOST_RACK, "m", "see rack.first"),
        ("rack: off along y by", found.rack[1], MOST_RACK, "m", "see rack.first"),
    )
    for name, value, most, unit, remedy in checks:
        if not abs(value) <= most:
            return f"{name} {value:.4f} {unit}; at most {most:g} {unit} allowed: {remedy}"
    return None


def point(values: Sequence[float]) -> str:
    """Return a place as a config file has it, m."""
    return f"[{', '.join(f'{value:.5f}' for value in values)}]"
