"""Places of plate and rack, measured by touching with pegs from the rack.

The results are height and tilt of the plate, place of the slots, and length of the pegs, all from the joints of this arm.
One touch gives the plate's height for a peg of the stated length. With several pegs, the mean is attributed to the plate
and the differences to the pegs.
"""

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path

import numpy as np

from cell.config.cell_config import CellConfig
from cell.devices.assembly import Cell, assemble, opened
from cell.records.statistics import student
from drivers.errors import CellError, NotCalibratedError
from drivers.figures_file import write_whole
from drivers.frames import end_point
from drivers.parts import PLATE_BORDER, Hole
from drivers.quantities import Pose, Vector
from skills.catalogue import GRASP, RECOVER
from skills.contract import Interrupted, Observation, Outcome, SkillContext
from skills.pace import at_pace
from skills.touch_off import TouchOff, touch_off

PEGS = 3
"""Number of pegs, taken from consecutive slots."""
MOST_FORCE = 25.0
"""Largest force at the TCP during a touch, N; above it the calibration ends."""
MOST_TILT = 0.05
"""Largest plausible tilt of the plate, rad."""
MOST_RACK = 5e-3
"""Largest plausible difference of the rack's place from the stated one, m."""


@dataclass(frozen=True, slots=True, eq=False)
class PegTouches:
    """Measurements with one peg."""

    slot: Vector
    """Measured minus stated centre of the slot's mouth, along x and y, shape (2,), m."""
    points: Vector
    """Touched points, computed with the stated length, shape (n, 3), m, base frame."""


@dataclass(frozen=True, slots=True)
class MeasuredPlaces:
    """Results of all pegs; lengths in m, pairs are a value and half the width of its 95 % interval."""

    date: date
    unit: str
    height: float
    """Height of the plate at the centre of the hole's area, base frame, if the mean peg has the stated length."""
    height_interval: float
    lean: tuple[tuple[float, float], ...]
    """Slopes of the plate along x and y for each peg, rad; each peg has its own workpiece if the line exchanges them."""
    uneven: float
    """Largest root mean square distance of a peg's points from their plane."""
    pegs: tuple[float, ...]
    """Length of each peg minus the mean length."""
    rack: tuple[float, float]
    """Measured minus stated place of the rack, along x and y."""
    rack_interval: tuple[float, float]
    centre: tuple[float, float, float]
    """Value for `hole.centre`."""
    first: tuple[float, float, float]
    """Value for `rack.first`."""
    is_plate_elsewhere: bool
    """True if the stated height is outside the interval, so that the file must be changed."""
    is_rack_elsewhere: bool
    """True if the stated place of the rack is outside an interval, so that the file must be changed."""

    @property
    def tilt(self) -> float:
        """Largest measured tilt of the plate, rad."""
        return max(math.hypot(*each) for each in self.lean)

    @property
    def sections(self) -> str:
        """Lines for the cell's file; empty if all stated values are within the intervals."""
        found = []
        if self.is_plate_elsewhere:
            found.append(("hole", "centre", point(self.centre)))
        if self.is_rack_elsewhere:
            found.append(("rack", "first", point(self.first)))
        return sections(found)

    def corrected(self, config: CellConfig) -> CellConfig:
        """Return the config with the values that `point` prints in place of its own."""
        hole, rack = config.hole, config.rack
        if self.is_plate_elsewhere:
            hole = hole.model_copy(update={"centre": tuple(round(x, 5) for x in self.centre)})
        if self.is_rack_elsewhere:
            rack = rack.model_copy(update={"first": tuple(round(x, 5) for x in self.first)})
        return config.model_copy(update={"hole": hole, "rack": rack})

    def write(self, path: Path) -> None:
        """Write a file whole or not at all.

        Raises:
            ConfigError: The file cannot be written; an existing file stays unchanged.
        """
        head = (
            f"# Touched off by `cell calibrate places` on {self.date}, arm {self.unit}; for the cell's file. SI units.\n"
            f"# Plate: height ± {self.height_interval:.2g}, tilt up to {self.tilt:.2g}, uneven by {self.uneven:.2g}.\n"
            f"# Rack: ± {self.rack_interval[0]:.2g} and ± {self.rack_interval[1]:.2g} along x and y; its height is taken as stated.\n"
            f"# Pegs, further out of the hand than in the mean: {', '.join(f'{x:.2g}' for x in self.pegs)}.\n"
        )
        write_whole(path, head + self.sections, "places")


def calibrate_places(config: CellConfig, today: date, done: Callable[[int, int], None], pegs: int) -> MeasuredPlaces:
    """Take pegs from the rack, touch the plate with each, bring the arm to rest, and return the measured places.

    Args:
        config: Config of the cell.
        today: Date of the calibration.
        done: Function called with the number of touches done and of all.
        pegs: Number of pegs to take, starting at the first slot, at least 2.

    Raises:
        NotCalibratedError: There is no peg or no contact, the force is too high, or the places are implausible.
        CellError: A device cannot be opened, times out, is stopped, or does not follow its setpoint.
    """
    if config.is_simulated and config.sim is not None:
        config = config.model_copy(update={"sim": config.sim.model_copy(update={"pace": "max"})})
    with opened(assemble(config)) as cell:
        return measured_places(cell, today, done, pegs)


def measured_places(cell: Cell, today: date, done: Callable[[int, int], None], pegs: int) -> MeasuredPlaces:
    """Do the work of `calibrate_places` with an open cell."""
    config, ctx = cell.config, cell.context(0)
    ctx.limits = config.limits.model_copy(update={"force": min(config.limits.force, MOST_FORCE)})
    ctx.stage = "calibrate places"
    try:
        if ctx.observe().gripper.is_gripping:
            raise NotCalibratedError("calibrate places: the hand holds something; `cell run recover` first")
        touched = [_touches(cell, ctx, slot, pegs, done) for slot in range(pegs)]
    except Interrupted as interruption:
        raise NotCalibratedError(
            f"calibrate places: {interruption.reason.name} at {ctx.limits.force:g} N allowed; check what the hand touched"
            " and where the peg is, then `cell run recover`"
        ) from None
    finally:
        with suppress(CellError):
            ctx.lead.rest.wait(ctx.devices.clock, ctx.schedule.period)
    found = places_of(touched, config, today)
    if (why := implausible(found, config)) is not None:
        raise NotCalibratedError(f"calibrate places: {why}")
    return found


def corners(hole: Hole) -> list[Vector]:
    """Return points around the hole's area, on solid plate, each shape (3,), m, base frame."""
    middle, (x, y) = np.array(hole.centre), (0.5 * extent + 0.5 * PLATE_BORDER for extent in hole.area)
    return [middle + np.array([sx * x, sy * y, 0.0]) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


def _touches(cell: Cell, ctx: SkillContext, slot: int, pegs: int, done: Callable[[int, int], None]) -> PegTouches:
    """Take the peg of a slot, touch the plate at every corner, and drop the peg into the bin."""
    config, places, pace = cell.config, corners(cell.config.hole), cell.config.pace()
    transfer, touch = at_pace(config.params(GRASP).transfer, pace), at_pace(TouchOff(), pace)
    ctx.job = config.job(slot=slot)
    cell.restock(ctx.job, config.first_seed + slot)
    closed: list[Pose] = []

    def watch(seen: Observation, _: object) -> None:
        # Rise of the hand above which it has left the slot, m.
        if seen.gripper.is_gripping and (not closed or seen.arm.tcp.position[2] < closed[0].position[2] + 1e-3):
            closed.append(seen.arm.tcp)

    ctx.callbacks = replace(ctx.callbacks, record=watch)
    (grasped,) = GRASP.run(config.skill_set(), ctx)
    ctx.callbacks = replace(ctx.callbacks, record=lambda seen, setpoint: None)
    if grasped.result.outcome is not Outcome.SUCCESS or not closed:
        raise NotCalibratedError(
            f"calibrate places: no peg from slot {slot % config.rack.slots + 1}: {grasped.result.reason.name}"
        )
    held = ctx.observe().peg
    points = []
    for number, place in enumerate(places, 1):
        found = touch_off(place, transfer, touch, ctx)
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
    """Return the centre of the mouth of the peg's slot from the hand's pose at the grasp, along x and y, shape (2,), m."""
    tip, axis = end_point(hand, theta, config.peg.length)
    across: Vector = tip + config.rack.depth * axis + offset * hand.rotation[:, 1]
    return across[:2]


def places_of(touched: Sequence[PegTouches], config: CellConfig, today: date) -> MeasuredPlaces:
    """Return the results of all pegs; a plane is fitted to the touched points of each peg."""
    repeated = 1e-4  # Repeatability of the arm, m, as a standard deviation; its maker states 0.1 mm.
    middle = np.array(config.hole.centre)
    planes = [plane_through(each.points - middle) for each in touched]
    heights = middle[2] + np.array([values[2] for values, _ in planes])
    height = float(heights.mean())
    quantile = student(len(touched) - 1)
    slots = np.array([each.slot for each in touched])
    apart = quantile * np.hypot(slots.std(axis=0, ddof=1), repeated) / math.sqrt(len(touched))
    rack = slots.mean(axis=0)
    sure = quantile * math.hypot(float(heights.std(ddof=1)), repeated) / math.sqrt(len(touched))
    first = (config.rack.first[0] + float(rack[0]), config.rack.first[1] + float(rack[1]), config.rack.first[2])
    return MeasuredPlaces(
        date=today,
        unit=config.arm_unit(),
        height=height,
        height_interval=sure,
        lean=tuple((float(values[0]), float(values[1])) for values, _ in planes),
        uneven=max(rms for _, rms in planes),
        # If a peg is longer than stated, the hand is higher at contact, so that the plate seems higher by that length.
        pegs=tuple(float(x) for x in heights - height),
        rack=(float(rack[0]), float(rack[1])),
        rack_interval=(float(apart[0]), float(apart[1])),
        centre=(config.hole.centre[0], config.hole.centre[1], height),
        first=first,
        is_plate_elsewhere=abs(height - config.hole.centre[2]) > sure,
        is_rack_elsewhere=bool(np.any(np.abs(rack) > apart)),
    )


def plane_through(points: Vector) -> tuple[Vector, float]:
    """Return slopes along x and y and height of the plane fitted to points, shape (n, 3), m, and their rms distance, m."""
    rows = np.column_stack([points[:, :2], np.ones(len(points))])
    values, *_ = np.linalg.lstsq(rows, points[:, 2], rcond=None)
    return np.asarray(values), float(np.sqrt(np.mean((points[:, 2] - rows @ values) ** 2)))


def implausible(found: MeasuredPlaces, config: CellConfig) -> str | None:
    """Return the first implausible value in words; None if all are plausible."""
    checks = (
        # Largest plausible difference of the plate's height from the stated one, m.
        ("plate: height off by", found.height - config.hole.centre[2], 0.01, "m", "see hole.centre"),
        ("plate: tilt", found.tilt, MOST_TILT, "rad", "level the plate"),
        (
            "plate: uneven by",
            found.uneven,
            # Largest plausible rms distance of the touched points from the fitted plane, m.
            1e-3,
            "m",
            "check what lies on it, and whether the peg slips in the hand",
        ),
        ("rack: off along x by", found.rack[0], MOST_RACK, "m", "see rack.first"),
        ("rack: off along y by", found.rack[1], MOST_RACK, "m", "see rack.first"),
    )
    for name, value, most, unit, remedy in checks:
        if not abs(value) <= most:
            return f"{name} {value:.4f} {unit}; at most {most:g} {unit} allowed: {remedy}"
    return None


def point(values: Sequence[float]) -> str:
    """Return a position in the format of a config file, m."""
    return f"[{', '.join(f'{value:.5f}' for value in values)}]"


def sections(lines: Sequence[tuple[str, str, str]]) -> str:
    """Return section, key and value of each line as text of the cell's file."""
    named: dict[str, list[str]] = {}
    for section, key, value in lines:
        named.setdefault(section, []).append(f"{key} = {value}\n")
    return "\n".join(f"[{section}]\n{''.join(rows)}" for section, rows in named.items())
