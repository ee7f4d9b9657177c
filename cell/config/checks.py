"""Checks across sections of a config: sizes, places, the workspace, and the stability of gains; pure.

Each check raises a ValueError of one line with the key, its value and the permitted values; `cell.config.cell_config` calls the
checks when it validates a config.
"""

import math
from collections.abc import Mapping

from cell.config.margins import MARGIN, Place, too_high
from cell.config.torque_path import is_steady, largest
from drivers.arm.model import ArmModel
from drivers.parts import Hole, Latch, Peg, Rack
from skills.grasp_from_rack import GraspFromRackParams
from skills.guards.limits import Limits
from skills.insert.grip import grip_of
from skills.insert.spiral_params import SpiralAdjustParams
from skills.motion import Gains
from skills.paper.params import PaperParams
from skills.plan import is_cornered
from skills.search.params import TOUCHED_TIME, SpraySearchParams
from skills.seating.decision import LEAST_PUSH

LATCH_MARGIN = 1.2
"""Largest force of a real latch relative to the stated force, ratio. Source: `latch.force` of config/reality.toml."""


def require_shallow(peg: Peg, hole: Hole, rack: Rack) -> None:
    """Require that the peg reaches the bottom of hole and slot."""
    for name, depth in (("hole.depth", hole.depth), ("rack.depth", rack.depth)):
        if depth >= peg.length:
            raise ValueError(
                f"{name} = {depth}: deeper than the peg reaches; less than peg.length = {peg.length} allowed"
            )


def require_apart(hole: Hole, rack: Rack) -> None:
    """Require that rack and plate of a simulated cell do not overlap."""
    (near, far), (least, most) = rack.bounds, hole.plate_bounds
    if all(near[i] < most[i] and least[i] < far[i] for i in range(2)):
        raise ValueError(
            f"rack.first = {list(rack.first)}: the rack overlaps the plate; slots outside x {least[0]:g} to {most[0]:g}, y"
            f" {least[1]:g} to {most[1]:g} allowed"
        )


def require_clear_way(grasp: GraspFromRackParams, search: SpraySearchParams, rack: Rack, peg: Peg) -> None:
    """Require that the grasp lifts the peg out of its slot, and that the descent to the plate fits in `search.touch_down`."""
    if grasp.clearance <= rack.depth:
        raise ValueError(
            f"grasp.clearance = {grasp.clearance}: leaves the peg in its slot; more than rack.depth = {rack.depth} allowed"
        )
    slowest = (search.first_height(peg.part.reach) + search.push_offset) / (search.touch_down - TOUCHED_TIME)
    if search.descent < slowest:
        raise ValueError(
            f"search.descent = {search.descent}: too slow to reach the plate within search.touch_down ="
            f" {search.touch_down} s; at least {math.ceil(1e4 * slowest) / 1e4} allowed"
        )


def require_workspace(limits: Limits) -> None:
    """Require a workspace with positive extent along every axis."""
    for low, high, axis in zip(limits.low, limits.high, "xyz", strict=True):
        if low >= high:
            raise ValueError(f"limits.low = {low} along {axis}: less than limits.high = {high} allowed")


def require_workspace_in_reach(limits: Limits, arm: ArmModel) -> None:
    """Require a workspace within the reach of the arm's hand."""
    shoulder, reach = arm.shoulder(), arm.reach()
    for name, corner in (("low", limits.low), ("high", limits.high)):
        for value, middle, axis in zip(corner, shoulder, "xyz", strict=True):
            if abs(value - middle) > reach:
                raise ValueError(
                    f"limits.{name} = {value} along {axis}: {arm.name} never reaches so far;"
                    f" {middle - reach:.2f} to {middle + reach:.2f} allowed"
                )


def require_permitted(followed: Mapping[str, Gains], arm: ArmModel) -> None:
    """Require that every gain is within the arm's bounds.

    Args:
        followed: Gains by the key of their section.
        arm: Figures of the arm.

    Raises:
        ValueError: A gain is above its bound; one line.
    """
    for kind, figure in (("translation", "stiffness"), ("rotation", "turn_stiffness")):
        for key, gains in followed.items():
            value, most = getattr(gains, kind), getattr(arm, figure)
            if value > most:
                raise ValueError(
                    f"{key}.{kind} = {value:g}: more than {figure} of {arm.name}; at most {most:g} allowed"
                )


def require_pressed(
    latch: Latch | None, adjust: SpiralAdjustParams, grasp: GraspFromRackParams, peg: Peg, limits: Limits
) -> None:
    """Require that the adjustment presses the part through its latch, within the friction limit of the pads.

    The push must exceed `LATCH_MARGIN` times the latch's force, plus the loss by friction in the arm's joints.
    """
    if latch is None:
        return
    grip, push = grip_of(grasp), adjust.push_stiffness * adjust.push_offset
    borne = grip.adjusting(adjust, peg.length)
    softened = borne.push_stiffness * borne.push_offset
    found = (
        (push, f"adjust.push_stiffness and adjust.push_offset push with {push:.3g} N"),
        (softened, f"the pads transmit only {softened:.3g} N at grasp.force = {grasp.force:g}"),
        (limits.force, f"limits.force = {limits.force:g}"),
    )
    least, why = min(found, key=lambda one: one[0])
    most = (least - LEAST_PUSH) / LATCH_MARGIN
    if latch.force > most:
        raise ValueError(
            f"hole.latch.force = {latch.force:g}: too high to overcome: {why}; at most {max(most, 0.0):.3g} allowed"
        )


def require_printable(paper: PaperParams, peg: Peg, hole: Hole) -> None:
    """Require a round peg and a switch for the skills as printed in the paper."""
    if is_cornered(peg.part):
        raise ValueError(
            f'peg.shape = "{peg.shape}": a printed skill of paper.skills inserts round pegs; "round" allowed'
        )
    if "adjust" in paper.skills and hole.evidence != "switch":
        raise ValueError(
            f'hole.evidence = "{hole.evidence}": the printed adjustment of paper.skills ends by the switch; "switch" allowed'
        )


def require_prior_inside(hole: Hole, limits: Limits) -> None:
    """Require that the likely place of the hole is in the workspace."""
    if hole.prior is not None:
        for low, high, mean, axis in zip(limits.low, limits.high, hole.prior.mean, "xyz", strict=False):
            if not low <= mean <= high:
                raise ValueError(
                    f"hole.prior.mean = {list(hole.prior.mean)}: outside the workspace along {axis};"
                    f" {low:g} to {high:g} of limits.low and limits.high allowed"
                )


def require_turned_as_hole(search: SpraySearchParams, peg: Peg) -> None:
    """Require that a peg with corners has the same rotation about the vertical as its hole."""
    azimuth, part = search.tilt_azimuth, peg.part
    turn = part.least_turn(azimuth)
    # Tolerance for the rotation of a peg with corners relative to its hole, rad; it covers rounded figures.
    if min(turn, part.symmetry - turn) > 1e-3:
        raise ValueError(
            f'search.tilt_azimuth = {azimuth:g}: a peg of peg.shape = "{peg.shape}" turns with the hand, and does not fit'
            f" the hole then; multiples of {part.symmetry:.4f} allowed"
        )


def require_reach(place: Place, hole: Hole, limits: Limits) -> None:
    """Require that the arm reaches the hole and can press there with the force limit."""
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
    """Require that every gain that acts on errors measured by the skin is stable, with the margin of `cell.config.margins`.

    Args:
        steered: Gains by the key of their section.
        rate: Rate of the skin's frames, Hz.
        place: Place and attitude of the arm at the hole.
    """
    for name, gains in steered.items():
        found = too_high(gains, rate, place)
        if found is not None:
            raise ValueError(
                f"{name}.{found.kind} = {found.gain:g}: unstable from {found.limit:.4g} with this damping ratio and"
                f" frames at {rate:g} Hz; at most {found.limit / MARGIN:.4g} allowed"
            )


def require_steady(followed: Mapping[str, Gains], place: Place) -> None:
    """Require that every gain, and the law of a halted arm, is stable despite the delay and low-pass of the arm's torques.

    The margin is that of `cell.config.margins`.

    Args:
        followed: Gains by the key of their section.
        place: Place and attitude of the arm at the hole.
    """
    path = place.arm.torque_path
    late = f"with {1e3 * path.transport:g} ms of delay and a low-pass of {path.cutoff:g} Hz on {place.arm.name}; stable up to {MARGIN} times needed"
    for name, gains in followed.items():
        if not is_steady(gains, place):
            raise ValueError(
                f"{name}: oscillates from {largest(gains, place):.2f} times the torques {late}: lower damping_ratio or stiffness"
            )
    if not is_steady(None, place):
        raise ValueError(
            f"arm: if halted, oscillates from {largest(None, place):.2f} times the torques {late}: correct torque_path in the arm's file"
        )
