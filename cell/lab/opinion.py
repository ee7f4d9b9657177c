"""A second opinion: whole trials on an arm from a description by others, compared with the cell's own arm."""

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.table import Table

from cell.lab.arguments import seeds_of
from cell.lab.compare import compared, config_of
from cell.lab.frontier.measure import Variant
from cell.lab.report import StudyReport, finite
from cell.lab.rows import write_rows
from cell.lab.tables import VARIANTS, Columns, table
from cell.lab.trials import TrialRow
from cell.records.statistics import Z95
from drivers.arm.inertia import joint_inertia
from drivers.arm.kinematics import jacobian, links
from drivers.arm.model import JOINTS, ArmModel
from drivers.errors import ConfigError
from drivers.quantities import Pose, Vector
from sim.arm.described_arm import GRAVITY, DescribedArm, apart, read
from sim.config import DescribedArmConfig
from skills.contract import Outcome

POSTURES = 1000
"""Number of postures for the comparison, drawn uniformly over the range that both permit."""
SEED = 1
"""Seed of the postures."""
NOTHING = 1e-10
"""Mass of an absent hand, kg, and its inertia, kg·m²: the description ends at the flange."""
NEGLIGIBLE = {"kinematics": 1e-5, "inertia": 1e-3}
"""Differences too small for any trial: of the flange's position, m and rad, and of the mass matrix, ratio."""
OURS, THEIRS = "the cell's own arm", "the described arm"
PACKAGE, FILE, BELIEF = "franka_sim", "models/fr3.urdf", "arm.model=fr3"
"""Package with a description of the arm, its file there, and the key of the described arm."""


class DescribedPart(NamedTuple):
    """Part of a description that is tested alone."""

    figures: str
    """Name in `Comparison.differs` of the figures; the part is tested only if they differ."""
    takes: tuple[str, ...]
    """Properties taken from the description, see `sim.described.takes`."""


PARTS = {
    "its kinematics alone": DescribedPart("kinematics", ("kinematics",)),
    "its inertia alone, weightless": DescribedPart("inertia", ("inertia",)),
    "its inertia alone": DescribedPart("inertia", ("inertia", "gravity")),
    "its friction alone": DescribedPart("friction", ("friction",)),
    "its rotors alone": DescribedPart("rotors", ("rotors",)),
}
"""Parts by name; links with weight leave a residual torque that the controller does not compensate."""
LINKS = "its links alone"
"""Name of kinematics and weighted links together; they are tested as a control if neither differs."""
EVERYTHING = ("kinematics", "inertia", "gravity", "friction", "rotors")


@dataclass(frozen=True, slots=True)
class Agreement:
    """Difference of one quantity between the description and the cell's assumption over the postures."""

    quantity: str
    unit: str
    median: float
    worst: float


@dataclass(frozen=True, slots=True)
class JointFigure:
    """One figure of the seven joints in the cell and in the description; SI."""

    name: str
    ours: tuple[float, ...]
    theirs: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Comparison:
    """Comparison of a description with the cell's arm."""

    agreements: list[Agreement]
    joints: list[JointFigure]
    differs: tuple[str, ...]
    """Parts with a difference that trials can show, of `kinematics`, `inertia`, `friction` and `rotors`."""


def compare(arm: ArmModel, described: DescribedArm, postures: int = POSTURES) -> Comparison:
    """Return the agreement of a description with the cell's assumptions, at this number of postures."""
    model = described.model
    low = np.maximum(arm.joints.q_min, model.jnt_range[:, 0])
    high = np.minimum(arm.joints.q_max, model.jnt_range[:, 1])
    bare = without_hand(arm)
    away, angle, mass, weight = [], [], [], []
    for q in np.random.default_rng(SEED).uniform(low, high, (postures, JOINTS)):
        rotations, origins = links(arm, q)
        flange = Pose(origins[-1] + arm.kinematics.flange * rotations[-1][:, 2], rotations[-1])
        apart_by = apart(described.pose_of_flange(q), flange)
        away.append(apart_by[0])
        angle.append(apart_by[1])
        M, held = described.inertia(q)
        ours = joint_inertia(bare, q)
        mass.append(float(np.linalg.norm(M - ours) / np.linalg.norm(ours)))
        weight.append(float(np.abs(held - gravity_torque(bare, q)).max()))
    agreements = [
        _agreement("place of the flange", "mm", away, 1000.0),
        _agreement("angle of the flange", "degrees", angle, math.degrees(1.0)),
        _agreement("mass matrix of the links, relative", "%", mass, 100.0),
        _agreement("torque of gravity, the joint that differs most", "N·m", weight, 1.0),
    ]
    joints = joint_figures(arm, described)
    is_other = {
        "kinematics": max(*away, *angle) > NEGLIGIBLE["kinematics"],
        "inertia": max(mass) > NEGLIGIBLE["inertia"],
        # The cell's own arm has drawn friction, whatever its file contains.
        "friction": True,
        "rotors": bool(model.dof_armature.any()),
    }
    return Comparison(agreements, joints, tuple(name for name, differs in is_other.items() if differs))


def joint_figures(arm: ArmModel, described: DescribedArm) -> list[JointFigure]:
    """Return friction, rotors and limits of the joints in both."""
    joints, model = arm.joints, described.model
    pairs = (
        ("dry friction, N·m", joints.friction, model.dof_frictionloss),
        ("viscous friction, N·m·s/rad", joints.viscous_friction or np.zeros(JOINTS), model.dof_damping),
        ("rotor inertia, kg·m²", joints.rotor_inertia, model.dof_armature),
        ("lower limit, rad", joints.q_min, model.jnt_range[:, 0]),
        ("upper limit, rad", joints.q_max, model.jnt_range[:, 1]),
        ("largest torque, N·m", joints.torque, model.jnt_actfrcrange[:, 1]),
    )
    return [
        JointFigure(name, tuple(float(x) for x in ours), tuple(float(x) for x in theirs))
        for name, ours, theirs in pairs
    ]


def without_hand(arm: ArmModel) -> ArmModel:
    """Return the arm with a hand of no mass."""
    nothing = {"mass": NOTHING, "inertia": (NOTHING, NOTHING, NOTHING, 0.0, 0.0, 0.0)}
    hand = arm.hand.model_copy(
        update={"body": arm.hand.body.model_copy(update=nothing), "finger": arm.hand.finger.model_copy(update=nothing)}
    )
    return arm.model_copy(update={"hand": hand})


def gravity_torque(arm: ArmModel, q: Vector) -> Vector:
    """Return the torques that hold the links against gravity by the cell's figures, shape (7,), N·m."""
    rotations, origins = links(arm, q)
    axes = np.array([R[:, 2] for R in rotations])
    torque = np.zeros(JOINTS)
    for i, (R, link) in enumerate(zip(rotations, arm.link, strict=True)):
        torque += link.mass * GRAVITY * jacobian(origins[i] + R @ link.com, axes, origins, i + 1)[2]
    return torque


def _agreement(quantity: str, unit: str, values: list[float], factor: float) -> Agreement:
    return Agreement(quantity, unit, factor * float(np.median(values)), factor * float(np.max(values)))


@dataclass(frozen=True, slots=True)
class Paired:
    """Differences of an arm from the cell's own on the same seeds."""

    name: str
    depth: float
    """Median depth of the tip in the hole over the successes, m; NaN where there are none."""
    pairs: int
    """Number of seeds with success on both arms."""
    slower: float
    """Mean difference of the total time over those seeds, this arm minus the cell's own, s."""
    slower_error: float
    """Half width of its 95 % interval, normal, s; NaN for fewer than two pairs."""
    harder: float
    """Median difference of the largest contact force over all seeds, N."""
    won: int
    """Number of seeds with success on this arm and not on the cell's own."""
    lost: int
    """Number of seeds with success on the cell's own arm and not on this one."""


def shipped_description() -> Path:
    """Return the description in a package.

    Raises:
        ConfigError: The package is not installed.
    """
    found = find_spec(PACKAGE)
    places = list(found.submodule_search_locations or ()) if found else []
    if not places or not (file := Path(places[0], FILE)).is_file():
        raise ConfigError(
            "study opinion: no description of an arm; name a URDF or MJCF file with --model, or install one, without the older "
            "packages that it asks for: pip install --no-deps -c constraints.txt franka-sim"
        )
    return file


def variants(described: DescribedArm, path: Path, compared: Comparison) -> list[Variant]:
    """Return the cell's own arm, the described one, and each differing part of it alone."""
    found = [Variant("opinion", OURS, None, ())]
    single = {name: part.takes for name, part in PARTS.items() if part.figures in compared.differs}
    if not {"kinematics", "inertia"} & set(compared.differs):
        single = {LINKS: ("kinematics", "inertia", "gravity"), **single}
    found += [Variant("opinion", name, None, (_key(described, path, takes),)) for name, takes in single.items()]
    return [*found, Variant("opinion", THEIRS, None, (_key(described, path, EVERYTHING),))]


def _key(described: DescribedArm, path: Path, takes: tuple[str, ...]) -> str:
    words = {"file": str(path.resolve()), "flange": described.flange, "sha256": described.digest, "takes": list(takes)}
    return f"sim.described={{{', '.join(f'{key} = {json.dumps(value)}' for key, value in words.items())}}}"


def paired(name: str, rows: Sequence[TrialRow], ours: Sequence[TrialRow]) -> Paired:
    """Return the differences of an arm's trials from those of the cell's own."""
    own = {row.seed: row for row in ours}
    pairs = [(own[row.seed], row) for row in rows if row.seed in own]
    both = [(a, b) for a, b in pairs if a.outcome == b.outcome == Outcome.SUCCESS]
    times = np.array([(b.total_time or 0.0) - (a.total_time or 0.0) for a, b in both])
    forces = [b.peak_contact_force - a.peak_contact_force for a, b in pairs]
    depths = [row.depth for row in rows if row.outcome == Outcome.SUCCESS]
    return Paired(
        name=name,
        depth=float(np.median(depths)) if depths else math.nan,
        pairs=len(both),
        slower=float(times.mean()) if both else math.nan,
        slower_error=Z95 * float(times.std(ddof=1)) / math.sqrt(len(both)) if len(both) > 1 else math.nan,
        harder=float(np.median(forces)) if forces else math.nan,
        won=sum(b.outcome == Outcome.SUCCESS != a.outcome for a, b in pairs),
        lost=sum(a.outcome == Outcome.SUCCESS != b.outcome for a, b in pairs),
    )


def run(args: argparse.Namespace) -> StudyReport:
    """Compare the figures, run every arm on the same seeds, write the table."""
    path = args.model or shipped_description()
    if args.model is None and not any(each.startswith("arm.model") for each in args.set):
        args.set.append(BELIEF)
    arm = config_of(args).arm_model()
    described = read(DescribedArmConfig(file=path, flange=args.flange), arm)
    postures = POSTURES // 20 if args.quick else POSTURES
    agreed = compare(arm, described, postures)
    tried = variants(described, path, agreed)
    found = compared(args, tried[-1:] if args.quick else tried, seeds_of(args, 20))
    ours = found.rows[0] if found.lines[0].variant == OURS else []
    pairs = [paired(line.variant, rows, ours) for line, rows in zip(found.lines, found.rows, strict=True)]
    shown = [_agreement_table(agreed, described, postures, arm.name), _joints_table(agreed)]
    shown.append(table(found.title, {"arm": lambda line: line.variant}, VARIANTS, found.lines))
    shown.append(table("Seed by seed, minus the cell's own arm", {"arm": lambda line: line.name}, PAIRED, pairs))
    result = {
        "title": found.title,
        "file": described.name,
        "sha256": described.digest,
        "flange": described.flange,
        "comparison": asdict(agreed),
        "lines": [asdict(line) | asdict(pair) for line, pair in zip(found.lines, pairs, strict=True)],
    }
    return StudyReport(shown, finite(result), [write_rows(result["lines"], found.folder / "opinion.csv")])


PAIRED: Columns = {
    "depth (mm)": lambda line: f"{1e3 * line.depth:.2f}",
    "more time (s, 95 %)": lambda line: f"{line.slower:+.1f} ± {line.slower_error:.1f}",
    "more force (N)": lambda line: f"{line.harder:+.1f}",
    "won, lost": lambda line: f"{line.won}, {line.lost}",
}


def _agreement_table(agreed: Comparison, described: DescribedArm, postures: int, arm: str) -> Table:
    turned = f", turned back by {math.degrees(described.turn):.0f} degrees" if described.turn else ""
    return table(
        f"{described.name} against {arm}: differences at {postures} postures",
        {"quantity": lambda each: each.quantity, "unit": lambda each: each.unit},
        {"median": lambda each: f"{each.median:.3g}", "worst": lambda each: f"{each.worst:.3g}"},
        agreed.agreements,
        f"MuJoCo's figures of the file against the cell's own, without a hand; flange: {described.flange}{turned}",
    )


def _joints_table(agreed: Comparison) -> Table:
    rows = [
        (each.name, whose, values)
        for each in agreed.joints
        for whose, values in (("the cell's", each.ours), ("described", each.theirs))
    ]
    figures: Columns = {str(n + 1): lambda row, n=n: f"{row[2][n]:.4g}" for n in range(JOINTS)}  # type: ignore[misc]
    caption = "a rotor inertia or a largest torque of 0 is not described, and the cell's own then counts"
    return table("Joints", {"figure": lambda row: row[0], "whose": lambda row: row[1]}, figures, rows, caption)
