"""Places of rack, plate, hole area and bin, shown by a person with the end of a peg; pure."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from cell.calibrate.hand_motion import GRIP, OPEN
from cell.calibrate.places import MOST_RACK, MOST_TILT, plane_through, point
from drivers.frames import UP, angle_between
from drivers.parts import Hole, Rack
from drivers.quantities import Vector
from skills.guards.limits import Limits

SLOTS = "123456789"
PLATE, AREA, BIN, UNDO, WRITE = "p", "h", "b", "u", "w"
MEANINGS = {
    f"{SLOTS[0]}-{SLOTS[-1]}": "mouth of that slot of the rack",
    PLATE: "corner of the plate",
    AREA: "corner of the area that contains the hole",
    BIN: "above the bin",
    UNDO: "take the last one back",
    WRITE: "write and end",
    "x y z X Y Z": "move the tool while held",
    GRIP: "close the fingers",
    OPEN: "open the fingers",
    "q": "end",
}
"""Meaning of each key."""


@dataclass(slots=True)
class Shown:
    """Places shown so far, in order: key, and position of the peg's end, shape (3,), m, base frame."""

    places: list[tuple[str, Vector]] = field(default_factory=list)

    def of(self, keys: str) -> list[tuple[str, Vector]]:
        """Return the places of some keys."""
        return [(key, place) for key, place in self.places if key in keys]

    def points(self, keys: str) -> Vector:
        """Return the places of some keys, shape (n, 3), m."""
        return np.array([place for _, place in self.of(keys)]).reshape(-1, 3)


def not_shown(key: str, axis: Vector, speed: float, rack: Rack) -> str | None:
    """Return the reason why a place cannot be recorded now; None if it can.

    Args:
        key: Key of the place.
        axis: Axis of the peg, from its end to the hand, shape (3,), base frame.
        speed: Speed of the fastest joint, rad/s.
        rack: The cell's rack.
    """
    shown_still = 0.05  # Largest speed of a joint at a shown place, rad/s.
    most_taught_lean = 0.3  # Largest angle between hand and vertical at a shown place, rad.
    if key in SLOTS and int(key) > rack.slots:
        return f"slot {key}: 1 to {rack.slots} of rack.slots allowed"
    if speed > shown_still:
        return f"arm: a joint moves at {speed:.2f} rad/s; at most {shown_still:g} rad/s allowed: hold it still"
    lean = angle_between(axis, UP)
    if lean > most_taught_lean:
        return f"arm: the hand leans by {lean:.2f} rad; at most {most_taught_lean:g} rad allowed: hold the peg upright"
    return None


def implausible(shown: Shown, rack: Rack, length: float, limits: Limits) -> str | None:
    """Return the first implausible value of the shown places in words; None if all are plausible.

    Args:
        shown: The places.
        rack: The cell's rack.
        length: Distance from the finger centre to the end of the cell's peg, m.
        limits: Limits of the workspace; they must contain the finger centre with the peg's end at each place.
    """
    return _outside(shown, length, limits) or _no_plate(shown) or _no_rack(shown, rack)


def _outside(shown: Shown, length: float, limits: Limits) -> str | None:
    for key, place in shown.places:
        for axis, there, low, high in zip("xyz", (place + length * UP).tolist(), limits.low, limits.high, strict=True):
            if not low <= there <= high:
                return (
                    f"{key}: hand at {axis} = {there:.3f} m with a peg there; {low:g} to {high:g} m of limits allowed"
                )
    return None


def _no_plate(shown: Shown) -> str | None:
    # Largest rms distance of the corners from the fitted plane, m; a person shows a place within millimetres.
    most_taught_uneven = 3e-3
    surface, area, plate = shown.points(PLATE + AREA), shown.points(AREA), shown.points(PLATE)
    if len(area) == 1:
        return "hole area: 1 corner; 2 or more allowed, of them two opposite ones"
    if len(surface) >= 3:
        (x, y, _), uneven = plane_through(surface)
        tilt, off = float(np.hypot(x, y)), surface[:, :2] - surface[:, :2].mean(axis=0)
        # Places in one line do not determine the tilt: an error of height e tilts a plane of width w by e/w.
        width = float(np.linalg.svd(off, compute_uv=False)[-1]) / np.sqrt(len(off))
        if tilt > MOST_TILT and width > most_taught_uneven / MOST_TILT:
            return f"plate: tilt {tilt:.3f} rad; at most {MOST_TILT:g} rad allowed"
        if uneven > most_taught_uneven:
            return f"plate: uneven by {uneven:.4f} m; at most {most_taught_uneven:g} m allowed"
    if len(plate) >= 2 and len(area):
        low, high = plate[:, :2].min(axis=0), plate[:, :2].max(axis=0)
        if np.any(area[:, :2] < low) or np.any(area[:, :2] > high):
            return "hole area: a corner lies beside the plate; corners within those of the plate allowed"
    return None


def _no_rack(shown: Shown, rack: Rack) -> str | None:
    firsts = _firsts(shown, rack)
    if len(firsts) < 2:
        return None
    apart = float(np.linalg.norm(firsts - firsts.mean(axis=0), axis=1).max())
    if apart <= MOST_RACK:
        return None
    return f"rack: the shown slots give places up to {apart:.4f} m from their mean; at most {MOST_RACK:g} m allowed: see rack.pitch"


def lines(shown: Shown, hole: Hole, rack: Rack) -> list[tuple[str, str, str]]:
    """Return section, key and value of each line for the cell's file from the shown places."""
    surface, area, found = shown.points(PLATE + AREA), shown.points(AREA), []
    if len(surface):
        middle, extent = np.array(hole.centre[:2]), None
        if len(area):
            low, high = area[:, :2].min(axis=0), area[:, :2].max(axis=0)
            middle, extent = 0.5 * (low + high), high - low
        found.append(("hole", "centre", point([*middle.tolist(), float(surface[:, 2].mean())])))
        if extent is not None:
            found.append(("hole", "area", point(extent.tolist())))
    if len(firsts := _firsts(shown, rack)):
        found.append(("rack", "first", point(firsts.mean(axis=0).tolist())))
    if len(bins := shown.points(BIN)):
        found.append(("recover", "bin", point(bins[-1].tolist())))
    return found


def _firsts(shown: Shown, rack: Rack) -> Vector:
    """Return the place of the first slot computed from each shown slot, shape (n, 3), m."""
    return np.array([place - [0.0, rack.pitch * (int(key) - 1), 0.0] for key, place in shown.of(SLOTS)]).reshape(-1, 3)


def key_taken(
    shown: Shown, rack: Rack, tell: Callable[[str], object], key: str, place: Vector, axis: Vector, speed: float
) -> None:
    """Record the place of a key, or remove the last one, and print it."""
    if key == UNDO:
        tell(f"taken back: {shown.places.pop()[0]}" if shown.places else "nothing to take back")
    elif key not in SLOTS + PLATE + AREA + BIN:
        tell(f"{key}: no such key; " + ", ".join(f"{name}: {what}" for name, what in MEANINGS.items()))
    elif (why := not_shown(key, axis, speed, rack)) is not None:
        tell(f"{why}; not taken")
    else:
        shown.places.append((key, place))
        tell(f"{key}: {point(place.tolist())} m")
