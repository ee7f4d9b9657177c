"""Insertion by force alone, as makers of arms ship it: a spiral under a constant push, then compliance; theta is set to 0.

Flexiv's SearchHole and the spiral searches of Universal Robots and KUKA follow this scheme. The peg leans as in the
cell's own search, because in an area of 60 mm an upright peg would need a pitch of a tenth of a millimetre. Insertion and
adjustment are the cell's own, without the skin.
"""

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from cell.devices.assembly import Cell
from cell.lab.frontier.hands import take_for_straight
from drivers.quantities import ImpedanceSetpoint, Vector
from skills import handling
from skills.catalogue import ADJUST, GRASP, INSERT, RECOVER, RELEASE, RETRIED, SEARCH
from skills.contract import Outcome, Reason, SkillContext, SkillResult
from skills.flow import StageRecord, in_order, run_stage
from skills.motion import VALIDITY, Goal
from skills.paths import spiral_at_speed
from skills.plan import InsertionPlan
from skills.pull_out import LONGEST, approach
from skills.search.spray_search import SpraySearchResult
from skills.search.surface import Plane, SurfaceEstimate

BORNE = 10
"""Number of scans for which the plate must bear the push before the spiral begins."""


@dataclass(frozen=True, slots=True)
class ForceSearch:
    """Parameters of the search."""

    speed: float = 0.08
    """Speed of the tip along the spiral, m/s."""
    pitch: float = 0.006
    """Distance between neighbouring turns, m."""
    push: float = 6.0
    """Push on the plate, N."""
    drop: float = 0.0005
    """Depth of the lowest point below the surface estimate above which the hand stops, m. If the depth still exceeds this value after
    the rest, the hole is found."""

    def spiral(self, time: float, reach: float) -> Vector:
        """Return the point of the spiral after a time, s, shape (2,), m: outwards up to `reach`, m, and back again."""
        longest = math.pi * reach**2 / (self.pitch * self.speed)  # time at which the spiral reaches the corners
        return spiral_at_speed(longest - abs(time % (2.0 * longest) - longest), self.speed, self.pitch)


def insert_by_force(cell: Cell, ctx: SkillContext, **figures: float) -> list[StageRecord]:
    """Take a peg, search, turn the peg upright and press it down, all by force alone; after a failure, search again as often as the
    cell's own program does.

    Args:
        cell: The simulated cell.
        ctx: The skills' context.
        figures: Values of fields of `ForceSearch` that replace the defaults.
    """
    take_for_straight(cell, ctx)
    # The plan of a later attempt (1) is used throughout, because it gives a jammed peg the whole stall timeout.
    skills, plan = cell.config.skill_set(), cell.config.plan(attempt=1)
    search = ForceSearch(**figures)
    search = replace(search, speed=search.speed * cell.config.speed_scale)
    records, attempt = GRASP.run(skills, ctx), 0
    while records[-1].result.outcome is Outcome.SUCCESS or records[-1].retried:
        records.append(run_stage(SEARCH.name, lambda c: find_by_force(search, plan, c), ctx))
        found = records[-1].result
        if isinstance(found, SpraySearchResult) and found.outcome is Outcome.SUCCESS:
            records += _seat(plan, found.plane, ctx)
        last = records[-1].result
        if last.outcome is Outcome.SUCCESS:
            records += RELEASE.run(skills, ctx)
            break
        if attempt == plan.retries or last.reason not in RETRIED:
            break
        records[-1], attempt = replace(records[-1], retried=True), attempt + 1
    last = records[-1].result
    if last.outcome is Outcome.FAILURE and last.reason is not Reason.STOPPED:
        records += RECOVER.run(skills, ctx)
    return records


def _seat(plan: InsertionPlan, plane: Plane | None, ctx: SkillContext) -> list[StageRecord]:
    steps = [
        (INSERT.name, lambda c: handling.insert(plan, c, plane)),
        (ADJUST.name, lambda c: handling.adjust(plan, c, plane)),
    ]
    return in_order(steps, ctx)


def find_by_force(params: ForceSearch, plan: InsertionPlan, ctx: SkillContext) -> SkillResult:
    """Slide along a spiral about the middle of the area under a constant push until the tip drops and stays down."""
    own, hole, part = plan.search, ctx.job.hole, ctx.job.peg.part
    v, closing = part.leaning(own.tilt_azimuth, own.tilt)
    middle, reach = np.array(hole.centre), math.hypot(*hole.area) / 2.0
    above = middle + np.array([0.0, 0.0, own.first_height(part.reach)])
    if (stuck := approach(Goal(above, v, closing), own.transfer, own.pull, ctx)) is not None:
        return _result(Outcome.FAILURE, Reason.NOT_SEATED, LONGEST, stuck)
    stiffness, damping_ratio = own.gains.stiffness(), own.gains.damping_ratios()
    stiffness[2] = own.push_stiffness
    lead, identity, surface = params.push / own.push_stiffness, ctx.new_id(), SurfaceEstimate()
    target, goal, tip, along = above.copy(), above[:2], above, 0.0
    stopped: float | None = None  # time at which the tip dropped
    borne = deque[bool](maxlen=BORNE)
    for seen in ctx.scan(own.timeout, holding=True):
        tip = seen.tip
        edge = part.lowest(tip, seen.axis, seen.arm.tcp.rotation[:, 2])
        # The push is the stiffness times the lead of the setpoint below the tip.
        target[2] = max(target[2] - own.descent * seen.step, tip[2] - lead)
        borne.append(target[2] <= tip[2] - lead)
        depth, deviation = surface.below(edge)
        dip = depth - deviation
        if stopped is None and dip > params.drop:
            stopped, goal = seen.elapsed, tip[:2]
        elif stopped is not None and seen.elapsed - stopped >= own.rest:
            if dip > params.drop:
                return _result(Outcome.SUCCESS, Reason.NONE, seen.running, tip, surface.plane(edge))
            stopped = None
        elif stopped is None and sum(borne) == BORNE:
            surface.learn(edge)
            along += seen.step
            goal = middle[:2] + params.spiral(along, reach)
        # To a stop, and back to the spiral, the setpoint moves at no more than twice the speed of the spiral.
        way = goal - target[:2]
        target[:2] += way * min(2.0 * params.speed * seen.step / max(math.hypot(*way), 1e-9), 1.0)
        ctx.callbacks.progress(seen.running / own.timeout)
        ctx.follow(
            ImpedanceSetpoint(
                id=identity,
                tip=target.copy(),
                axis=v,
                roll=closing,
                stiffness=stiffness,
                damping_ratio=damping_ratio,
                valid_until=seen.stamp + VALIDITY,
                in_hand=ctx.in_hand(),
            )
        )
    return _result(Outcome.FAILURE, Reason.NO_HOLE, own.timeout, tip)


def _result(
    outcome: Outcome, reason: Reason, elapsed: float, tip: Vector, plane: Plane | None = None
) -> SpraySearchResult:
    x, y, z = (float(each) for each in tip)
    return SpraySearchResult(outcome, reason, elapsed, (x, y, z), (x, y), rests=1, plane=plane, edge=(x, y))
