"""Rules of the method that are not insurance, with their replacements, and the scenes that they were made for."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from cell.lab.ablation.switch import Rule

THIN = ("peg.diameter=0.004", "hole.diameter=0.0041")
SCENES: Mapping[str, Sequence[str]] = {
    "honest": (),
    "careless": ("reality.scale=2",),
    "fast, careless": ("preset=fast", "reality.scale=2"),
    "thin": THIN,
    "thin, fast": ("preset=fast", *THIN),
    "turning": ("grasp.force=15.0", "grip.friction=0.3"),
    "soft": ("world=soft",),
    "decoys": ("world=decoys",),
    "latch": ('hole.latch={kind="detent",force=5.0,height=0.003}', "hole.evidence=force"),
    "hertz": ("world=hertz",),
    "foam": ("world=foam",),
    "stribeck": ("world=stribeck",),
    "corners": ("peg.shape=square",),
    "wrong place": ("hole.prior={mean=[0.51,0.01],deviation=[0.0007,0.0007]}",),
    "vague place": ("hole.prior={mean=[0.5,0.0],deviation=[0.015,0.015]}",),
}
"""Scenes by name, as keys of the config."""
CORNERS = ("corners",)
PLACES = ("wrong place", "vague place")
ROUND = tuple(name for name in SCENES if name not in CORNERS)
PADS = ("honest", "careless", "turning", "soft", "hertz", "foam")


def _never(real: Any, *args: Any, **kwargs: Any) -> bool:
    return False


def _zero(real: Any, *args: Any, **kwargs: Any) -> float:
    return 0.0


def _nothing(real: Any, *args: Any, **kwargs: Any) -> None:
    return None


def _same(real: Any, itself: Any, *args: Any, **kwargs: Any) -> Any:
    return itself


def _not_probed(real: Any, phase: Any, felt: Any, params: Any, course: Any, point: Any) -> Any:
    return real(replace(phase, was_probed=True), felt, params, course, point)


def _by_breadths(
    real: Any, prints: Any, values: Any, weights: Any, is_wide: bool = False, load: Any = (0.0, 0.0)
) -> Any:
    found = prints._breadths.compare(values, weights, is_wide, prints._believed, load)
    prints.left = prints._breadths.left
    return found


def _straight(real: Any, bank: Any, params: Any, templates: Any) -> None:
    real(bank, params, templates)
    bank._places = (templates.along, templates.borne * 0.0)


def _no_short(real: Any, estimator: Any, *args: Any) -> None:
    real(estimator, *args)
    estimator._against_short = 1e9


SEARCH: Sequence[Rule] = (
    Rule(
        "sudden fall",
        "A drop of peg and hand within 50 ms counts from 0.6 of the dip threshold, and from more after each stop without a hole.",
        "skills.search.feel:EdgeEvidence.update",
        values={"skills.search.feel:FAINT": 1e9},
        acts=lambda result, evidence, *_: result[1] and result[0] <= evidence._params.dip_threshold,
    ),
    Rule(
        "push-back",
        "Each slip of the peg in the hand reduces the push by a fifth.",
        "skills.search.feel:Push.after",
        off=_same,
    ),
    Rule(
        "area outwards",
        "Behind a likely place the lanes cover the area from there outwards.",
        "skills.search.course:outwards",
        off=lambda real, *_: [],
        scenes=PLACES,
    ),
    Rule(
        "likely place",
        "Half the dip threshold counts where the hole is likely.",
        values={"skills.search.feel:LIKELY": 1.0},
        target="skills.search.feel:EdgeEvidence.update",
        acts=lambda result, evidence, seen, edge, is_likely=False: (
            is_likely and result[0] > 0.5 * evidence._params.dip_threshold
        ),
        scenes=ROUND,
    ),
    Rule(
        "probe",
        "A stop that found no hole is followed by a spiral of 3 mm around it.",
        "skills.search.sweep:after_rest",
        off=_not_probed,
        acts=lambda phase, before, *_: type(phase).__name__ == "Probing",
    ),
    Rule(
        "dip gone",
        "A dip of a corner that is gone at rest is not probed.",
        "skills.search.phases:Resting.is_gone",
        off=_never,
        scenes=CORNERS,
    ),
    Rule(
        "decoy at touch-down",
        "A touch-down below the plate beside a decoy, twice, is a decoy.",
        "skills.search.sweep:SearchSweep._has_come_down_in_decoy",
        off=_never,
        scenes=ROUND,
    ),
    Rule(
        "stuck in a dent",
        "A place in which the peg rests three times is passed over.",
        "skills.search.sweep:SearchSweep._is_stuck",
        off=_never,
    ),
    Rule(
        "slip on the plate",
        "The sunk surface at the last touch-down corrects the length of the peg after the search.",
        "skills.search.spray_search:_referenced",
        off=lambda real, plane, *_: plane,
    ),
    Rule(
        "border lanes",
        "Every second cover has its lanes between those of the first and along both borders.",
        "skills.paths:Lanes._place",
        off=lambda real, lanes, lane: (lanes.lanes - 1) / 2.0 - lane % lanes.lanes,
        acts=lambda place, lanes, lane: lane >= lanes.lanes + 1,
    ),
    Rule(
        "trim",
        "An integral moves the setpoint across the lanes against joint friction.",
        keys=("search.trim_limit=0.0",),
        always=True,
        scenes=ROUND,
    ),
    Rule(
        "drop of the hand",
        "A dip counts only with a drop of the hand.",
        "skills.search.feel:EdgeEvidence._drop",
        off=lambda real, evidence, height: 1.0,
        always=True,
    ),
    Rule(
        "firm push",
        "A thin peg is pushed with 7.5 N.",
        "skills.plan:firm",
        off=lambda real, search, thickness: search,
        always=True,
        scenes=("thin", "thin, fast"),
    ),
    Rule(
        "crossing speed",
        "The speed along a lane is bounded by 21 diameters of the hole in a second.",
        "skills.plan:fastest",
        off=lambda real, dip, width: 9.9,
        always=True,
        scenes=("thin, fast",),
    ),
)
SEATING: Sequence[Rule] = (
    Rule(
        "tilt sweep",
        "A peg that makes no progress is swept about the closing axis as far as the walls permit.",
        "skills.insert.guided_peg:TiltSweep.next",
        off=_same,
    ),
    Rule(
        "aim at the resting peg",
        "Every second jam aims along the resting peg instead of the felt normal.",
        "skills.insert.guided_peg:Aim.freed",
        off=lambda real, aim, in_hand, tcp, normal: replace(aim, in_hand=in_hand, direction=normal),
        acts=lambda aim, *_: not aim.is_by_plate,
    ),
    Rule(
        "kept sweep",
        "A swept peg that slides keeps the present orientation of the hand.",
        "skills.insert.guided_peg:Aim.kept",
        off=_same,
    ),
    Rule(
        "fading dither",
        "The circles fade with the speed of the peg.",
        "skills.insert.guided_peg:Descent.rest",
        off=lambda real, descent: 1.0,
        always=True,
    ),
    Rule(
        "swing",
        "While the hand still swings from the insertion, the peg is damped more and pushed less.",
        "skills.insert.spiral_adjust:Swing.after",
        off=_same,
        acts=lambda swing, *_: swing.rate > 0.15,
    ),
    Rule(
        "patience at the bottom",
        "A peg at the bottom is given twice the stall timeout.",
        values={"skills.plan:AT_BOTTOM": 1.0},
        always=True,
        scenes=("careless", "turning", "latch"),
    ),
    Rule(
        "first patience",
        "The first attempt gives up after 0.4 of the stall timeout.",
        values={"skills.plan:FIRST_STALL": 1.0},
        always=True,
        scenes=("careless", "turning", "decoys"),
    ),
    Rule(
        "halved grip",
        "Each slip along the fingers halves the grip that pushes count on.",
        "skills.held_peg:HeldPeg.slipped",
        off=_same,
    ),
    Rule(
        "slip of turns",
        "The push over the plate and down the hole leaves a margin for the slip of a rotating peg.",
        "skills.insert.grip:Grip.bears_over_plate",
        off=lambda real, grip, tilt, dip: grip.bears,
        always=True,
        scenes=("turning", "soft", "careless"),
    ),
    Rule(
        "rising push",
        "The push of the insertion rises as the peg aligns, Eq. (7).",
        keys=("insert.push_stiffness=[500.0,500.0]",),
        always=True,
        scenes=("honest", "careless"),
    ),
    Rule(
        "damped arrival",
        "The peg is damped more within 5 mm of the bottom.",
        values={"skills.insert.spiral_adjust:ARRIVING": 1.0},
        always=True,
        scenes=("honest", "careless", "latch"),
    ),
)
ANGLE: Sequence[Rule] = (
    Rule(
        "faults of a frame",
        "A frame that does not fit is compared with prints of dead modules, short pegs and single wrong taxels.",
        "skills.tactile.robust:RobustEstimator._think_again",
        off=lambda real, estimator, values, weights, silent, usual: (usual, estimator._usual, weights),
        acts=lambda *_: True,
        scenes=PADS,
    ),
    Rule(
        "short pegs",
        "Such a frame is compared with the prints of every shorter length.",
        "skills.tactile.robust:RobustEstimator.__init__",
        off=_no_short,
        always=True,
        scenes=PADS,
    ),
    Rule(
        "outliers",
        "Readings that do not fit the best explanation are left out.",
        "skills.tactile.robust:RobustEstimator._without_outliers",
        off=lambda real, estimator, values, best: (best.found, best.weights),
        acts=lambda *_: True,
        scenes=PADS,
    ),
    Rule(
        "lengths",
        "Every frame is compared with prints of five lengths of the peg.",
        "skills.tactile.robust:UsualPrints.compare",
        off=_by_breadths,
        always=True,
        scenes=PADS,
    ),
    Rule(
        "breadth",
        "The breadth of the print is learnt from frames at other angles.",
        "skills.tactile.robust:UsualPrints.learn",
        off=_nothing,
        values={"skills.tactile.robust:BREADTHS": (1.0,), "skills.tactile.robust:AT_FIRST": (0.0, 8.0)},
        always=True,
        scenes=PADS,
    ),
    Rule(
        "load",
        "The load of a pad is learnt and expected in the next frame.",
        "skills.tactile.robust:Load.expected",
        off=lambda real, load: (0.0, 0.0),
        always=True,
        scenes=PADS,
    ),
    Rule(
        "load and its curve",
        "The load of a pad is learnt, and curved along a tilted peg.",
        "skills.tactile.likelihood:Bank.__init__",
        off=_straight,
        values={"skills.tactile.robust:Load.expected": property(lambda load: (0.0, 0.0))},
        always=True,
        scenes=PADS,
    ),
    Rule(
        "jump",
        "An angle that differs by more than 9 degrees counts when the next frame confirms it.",
        "skills.tactile.blend:Smoothing.jump_of",
        off=_zero,
        scenes=(*PADS, *CORNERS),
    ),
    Rule(
        "twist",
        "Theta follows the moment of the arm between frames.",
        keys=("smoothing.softest=0.0",),
        always=True,
        scenes=("honest", "soft"),
    ),
)
CORNER: Sequence[Rule] = (
    Rule(
        "yaw of further attempts",
        "Further attempts sweep the yaw about another middle.",
        keys=("corner.insert.centres=[0.0]",),
        target="skills.corner.insert:sweep_of",
        acts=lambda sweep, params, *_: params.centre != 0.0,
        scenes=CORNERS,
    ),
    Rule(
        "lag",
        "A lag of the corner behind its setpoint is evidence of the hole.",
        keys=("corner.lag=1.0",),
        target="skills.search.sweep:SearchSweep._felt",
        acts=lambda felt, *_: felt.is_held,
        scenes=CORNERS,
    ),
    Rule(
        "blended frames",
        "Theta of a peg with corners takes half of each frame.",
        keys=("corner.blend=1.0",),
        always=True,
        scenes=CORNERS,
    ),
    Rule(
        "dither of the raised corner",
        "The raised peg is dithered while its yaw is swept.",
        keys=("corner.insert.dither_radius=0.0",),
        always=True,
        scenes=CORNERS,
    ),
    Rule(
        "dither of the entering corner",
        "The peg is dithered while it enters.",
        keys=("corner.adjust.dither_radius=0.0",),
        always=True,
        scenes=CORNERS,
    ),
    Rule(
        "softer raise",
        "The push is reduced while the peg is raised.",
        keys=("corner.insert.push_back=1.0",),
        always=True,
        scenes=CORNERS,
    ),
    Rule(
        "press after the raise",
        "The corner is pressed along the closing axis once the peg is raised.",
        keys=("corner.insert.press=0.0",),
        always=True,
        scenes=CORNERS,
    ),
    Rule(
        "stuck entry",
        "A guided peg that stands for 0.8 s goes on to the adjustment.",
        "skills.corner.adjust:EntryWatch.is_caught",
        off=_never,
        scenes=CORNERS,
    ),
    Rule(
        "strayed by both angles",
        "The corner has strayed only if both angles say so for 0.15 s.",
        values={"skills.corner.adjust:STRAYED_FOR": 0.0},
        target="skills.corner.adjust:EntryWatch.has_strayed",
        acts=lambda result, watch, elapsed: elapsed > watch.inside,
        scenes=CORNERS,
    ),
    Rule(
        "moment over a corner",
        "The pushes on a leaning corner are scaled until the pads bear force and moment.",
        "skills.insert.grip:Grip.load_over_corner",
        off=lambda real, grip, down, across, tilt, peg: 0.0,
        always=True,
        scenes=CORNERS,
    ),
)
RULES: Mapping[str, Rule] = {rule.name: rule for rule in (*SEARCH, *SEATING, *ANGLE, *CORNER)}
"""Rules by name."""


def rules_of(scene: str) -> list[Rule]:
    """Return the rules that are judged in a scene."""
    return [rule for rule in RULES.values() if not rule.scenes or scene in rule.scenes]
