"""Checks that sections of a config go together: sizes, places, the workspace, and the stability of gains; pure.

Each raises a ValueError in one line that names the key, its value and what is allowed; `cell.cell_config` calls them when a
config is validated.
"""

import math
from collections.abc import Mapping

from cell.margins import MARGIN, Place, too_high
from cell.torque_path import is_hold_steady, is_steady, largest, largest_hold
from drivers.arm.model import ArmModel
from drivers.parts import Hole, Latch, Peg, Rack
from skills.grasp_from_rack import GraspFromRackParams
from skills.grip import grip_of
from skills.handling import is_printed_for
from skills.motion import Gains, Transfer
from skills.paper.params import PaperParams
from skills.search.params import TOUCHED_TIME, SpraySearchParams
from skills.seating import LEAST_PUSH
from skills.setpoint_gate import Limits
from skills.spiral_params import SpiralAdjustParams

LATCH_MARGIN = 1.2
"""Factor by which a real latch may resist more than is stated, ratio. Source: `latch.force` of config/reality.toml."""
LEAST_TURN = 1e-3
"""Turn of a peg with corners against its hole that is left out of account, rad; what a rounded figure makes."""


def require_shallow(peg: Peg, hole: Hole, rack: Rack) -> None:
    """Make sure that the peg reaches the bottom of hole and slot.

    Raises:
        ValueError: One of them is as deep as the peg reaches; one line.
    """
    for name, depth in (("hole.depth", hole.depth), ("rack.depth", rack.depth)):
        if depth >= peg.length:
            raise ValueError(
                f"{name} = {depth}: deeper than the peg reaches; less than peg.length = {peg.length} allowed"
            )


def require_apart(hole: Hole, rack: Rack) -> None:
    """Make sure that rack and plate of a simulated cell do not overlap.

    Raises:
        ValueError: They do; one line.
    """
    (near, far), (least, most) = rack.bounds, hole.plate_bounds
    if all(near[i] < most[i] and least[i] < far[i] for i in range(2)):
        raise ValueError(
            f"rack.first = {list(rack.first)}: the rack overlaps the plate; slots outside x {least[0]:g} to {most[0]:g}, y"
            f" {least[1]:g} to {most[1]:g} allowed"
        )


def require_clear_way(grasp: GraspFromRackParams, search: SpraySearchParams, rack: Rack, peg: Peg) -> None:
    """Make sure that the peg is drawn out of its slot, and comes down to the plate in the time for that.

    Raises:
        ValueError: A height or a speed is too small; one line.
    """
    if grasp.clearance <= rack.depth:
        raise ValueError(
            f"grasp.clearance = {grasp.clearance}: leaves the peg in its slot; more than rack.depth = {rack.depth} allowed"
        )
    slowest = (search.first_height(peg.part.reach) + search.push_offset) / (search.touch_down - TOUCHED_TIME)
    if search.descent < slowest:
        raise ValueError(
            f"search.descent = {search.descent}: not down within search.touch_down = {search.touch_down} s;"
            f" at least {math.ceil(1e4 * slowest) / 1e4} allowed"
        )


def require_workspace(limits: Limits) -> None:
    """Make sure that the workspace has an extent along every axis.

    Raises:
        ValueError: It has none; one line.
    """
    for low, high, axis in zip(limits.low, limits.high, "xyz", strict=True):
        if low >= high:
            raise ValueError(f"limits.low = {low} along {axis}: less than limits.high = {high} allowed")


def require_workspace_in_reach(limits: Limits, arm: ArmModel) -> None:
    """Make sure that the workspace ends where the arm's hand can be at all.

    Raises:
        ValueError: A corner lies further out along an axis than the arm reaches; one line.
    """
    shoulder, reach = arm.shoulder(), arm.reach()
    for name, corner in (("low", limits.low), ("high", limits.high)):
        for value, middle, axis in zip(corner, shoulder, "xyz", strict=True):
            if abs(value - middle) > reach:
                raise ValueError(
                    f"limits.{name} = {value} along {axis}: {arm.name} never reaches so far;"
                    f" {middle - reach:.2f} to {middle + reach:.2f} allowed"
                )


def require_permitted(followed: Mapping[str, Gains], ways: Mapping[str, Transfer], arm: ArmModel) -> None:
    """Make sure that no gain and no speed is more than the arm may be asked for.

    Args:
        followed: Gains by the key of their section.
        ways: Ways through free space by the key of their section.
        arm: Figures of the arm.

    Raises:
        ValueError: One is; one line.
    """
    asked = [
        *((f"{key}.translation", gains.translation, arm.stiffness, "stiffness") for key, gains in followed.items()),
        *((f"{key}.rotation", gains.rotation, arm.turn_stiffness, "turn_stiffness") for key, gains in followed.items()),
        *((f"{key}.speed", way.speed, arm.tool_speed, "tool_speed") for key, way in ways.items()),
        *((f"{key}.turn_speed", way.turn_speed, arm.tool_turn_speed, "tool_turn_speed") for key, way in ways.items()),
    ]
    for key, value, most, figure in asked:
        if value > most:
            raise ValueError(f"{key} = {value:g}: more than {figure} of {arm.name}; at most {most:g} allowed")


def require_pressed(
    latch: Latch | None, adjust: SpiralAdjustParams, grasp: GraspFromRackParams, peg: Peg, limits: Limits
) -> None:
    """Make sure that the adjustment presses the part through its latch, with what its pads bear.

    A push that goes through exceeds the latch's force by `LATCH_MARGIN`, and then by what friction in the arm's joints keeps.

    Raises:
        ValueError: The push, the grip or the force limit is too small for the latch; one line.
    """
    if latch is None:
        return
    grip, push = grip_of(grasp), adjust.push_stiffness * adjust.push_offset
    borne = grip.adjusting(adjust, peg.length)
    softened = borne.push_stiffness * borne.push_offset
    found = (
        (push, f"adjust.push_stiffness and adjust.push_offset push with {push:.3g} N"),
        (softened, f"the pads bear a push of {softened:.3g} N at grasp.force = {grasp.force:g}"),
        (limits.force, f"limits.force = {limits.force:g}"),
    )
    least, why = min(found, key=lambda one: one[0])
    most = (least - LEAST_PUSH) / LATCH_MARGIN
    if latch.force > most:
        raise ValueError(
            f"hole.latch.force = {latch.force:g}: not pressed through, as {why}; at most {max(most, 0.0):.3g} allowed"
        )


def require_printable(paper: PaperParams, peg: Peg, hole: Hole) -> None:
    """Make sure that the printed skills have the part and the evidence that they are made for.

    Raises:
        ValueError: The peg has corners, or no switch decides; one line.
    """
    if not is_printed_for(peg.part):
        raise ValueError(
            f'peg.shape = "{peg.shape}": a printed skill of paper.skills inserts round pegs; "round" allowed'
        )
    if "adjust" in paper.skills and hole.evidence != "switch":
        raise ValueError(
            f'hole.evidence = "{hole.evidence}": the printed adjustment of paper.skills ends by the switch; "switch" allowed'
        )


def require_prior_inside(hole: Hole, limits: Limits) -> None:
    """Make sure that the likely place of the hole lies in the workspace.

    Raises:
        ValueError: It lies outside; one line.
    """
    if hole.prior is not None:
        for low, high, mean, axis in zip(limits.low, limits.high, hole.prior.mean, "xyz", strict=False):
            if not low <= mean <= high:
                raise ValueError(
                    f"hole.prior.mean = {list(hole.prior.mean)}: outside the workspace along {axis};"
                    f" {low:g} to {high:g} of limits.low and limits.high allowed"
                )


def require_turned_as_hole(search: SpraySearchParams, peg: Peg) -> None:
    """Make sure that the hand holds a peg with corners as its hole is turned.

    Raises:
        ValueError: The tilt azimuth turns the peg against the hole; one line.
    """
    azimuth, part = search.tilt_azimuth, peg.part
    turn = part.least_turn(azimuth)
    if min(turn, part.symmetry - turn) > LEAST_TURN:
        raise ValueError(
            f'search.tilt_azimuth = {azimuth:g}: turns the hand, and with it a peg of peg.shape = "{peg.shape}",'
            f" against the hole; multiples of {part.symmetry:.4f} allowed"
        )


def require_reach(place: Place, hole: Hole, limits: Limits) -> None:
    """Make sure that the arm reaches the hole, and can press there with as much as the force limit.

    Raises:
        ValueError: It does not reach, or cannot press so hard; one line.
    """
    if not place.is_within_reach():
        raise ValueError(
            f"hole.centre = {hole.centre}: the arm, {place.arm.name}, does not reach it with the peg upright and"
            f" tilted by {place.tilt} rad; a place within its reach allowed"
        )
    if limits.force > (most := place.largest_push()):
        raise ValueError(
            f"limits.force = {limits.force:g}: more than {place.arm.name} can press with at hole.centre;"
            f" at most {math.floor(most)} allowed"
        )


def require_stable(steered: Mapping[str, Gains], rate: float, place: Place) -> None:
    """Make sure that every gain which acts on what the skin tells is stable by the margin of `cell.margins`.

    Args:
        steered: Gains by the key of their section.
        rate: Rate of the skin's frames, Hz.
        place: Place and attitude in which the arm works.

    Raises:
        ValueError: A gain is too high; one line with the largest one allowed.
    """
    for name, gains in steered.items():
        found = too_high(gains, rate, place)
        if found is not None:
            raise ValueError(
                f"{name}.{found.kind} = {found.gain:g}: unstable from {found.limit:.4g} with this damping ratio and"
                f" frames at {rate:g} Hz; at most {found.limit / MARGIN:.4g} allowed"
            )


def require_steady(followed: Mapping[str, Gains], place: Place) -> None:
    """Make sure that every gain, and the hold of a halted arm, bears the arm's torque path by the margin of `cell.margins`.

    Args:
        followed: Gains by the key of their section.
        place: Place and attitude in which the arm works.

    Raises:
        ValueError: A gain, or the hold, would let the arm swing; one line.
    """
    path = place.arm.torque_path
    late = f"where they act {1e3 * path.transport:g} ms late behind {path.cutoff:g} Hz on {place.arm.name}; {MARGIN} times needed"
    for name, gains in followed.items():
        if not is_steady(gains, place):
            raise ValueError(
                f"{name}: swings from {largest(gains, place):.2f} times these torques {late}: lower damping_ratio or the stiffness"
            )
    if not is_hold_steady(place):
        raise ValueError(
            f"arm: once halted, swings from {largest_hold(place):.2f} times its torques {late}: torque_path of the arm's file"
        )
