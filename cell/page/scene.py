"""The scene of the 3D view, and the samples of a recorded run for its replay, as data for a browser; pure."""

import json
from pathlib import Path

import numpy as np

from cell.page.traces import POINTS, STEP
from cell.records.samples import read_facts, read_samples
from drivers.errors import JournalError
from drivers.quantities import FINGER_NAMES, Vector
from drivers.scene_facts import BRIGHT, NOISE, PALETTE, SceneFacts
from drivers.skin.layout import finger_positions, pad_size, triangles
from skills.catalogue import CATALOGUE

CURVES = ("time", "force", "depth", "x", "y", "theta", "stage", "width", "switch")
"""First values of a sample of a replay, in the units of `traces.NAMES`; then follow joints, pose of the peg, taxels."""
PLACES = [f"true_peg_{part}" for part in ("x", "y", "z", "qw", "qx", "qy", "qz")]


def scene(facts: SceneFacts) -> dict[str, object]:
    """Return arm, hand, part, places and skin; lengths in m, angles in rad, base frame."""
    chain, hand, job = facts.arm.kinematics, facts.arm.hand, facts.job
    return {
        "arm": {"a": chain.a, "d": chain.d, "alpha": chain.alpha, "flange": chain.flange},
        "hand": {"turn": hand.turn, "centre": hand.finger_centre, "stroke": hand.stroke, "pad": pad_size(facts.layout)},
        "rack": {"first": job.rack.first, "pitch": job.rack.pitch, "slots": job.rack.slots},
        "peg": {
            "length": job.peg.length,
            "overhang": job.peg.overhang,
            "outline": job.peg.part.outline().round(6).tolist(),
            "open": facts.widest,
        },
        "hole": {
            "centre": job.hole.centre,
            "area": job.hole.area,
            "depth": job.hole.depth,
            "outline": job.hole.part.outline().round(6).tolist(),
        },
        "fingers": FINGER_NAMES,
        "taxels": finger_positions(facts.layout).round(6).tolist(),
        "triangles": triangles(facts.layout).tolist(),
        "colours": {"least": NOISE, "most": BRIGHT, "palette": PALETTE},
    }


def replay(path: Path) -> bytes:
    """Return the scene, the names of the curves, and then the samples of a run, thinned out like a live trace.

    The first four bytes are the length of a head in JSON, a multiple of 4; then follow the samples as 32-bit floats. All
    numbers are little-endian.

    Raises:
        JournalError: The run has no samples, or was recorded without the facts of the scene.
    """
    facts, samples = read_facts(path), read_samples(path)
    times = samples["stamp"] - samples["stamp"][:1]
    if not times.size:
        raise JournalError(f"{path}: no samples on record")
    step = max(STEP, float(times[-1]) / POINTS)
    scans = np.unique(np.searchsorted(times, np.append(np.arange(0.0, times[-1], step), times[-1]) - 1e-9))
    chosen = {name: values[scans] for name, values in samples.items()}
    curves = _curves(chosen, times[scans], facts)
    rows = np.column_stack([curves, chosen["joints"], *(chosen[name] for name in PLACES), chosen["taxels"]])
    head = {"scene": scene(facts), "names": CURVES, "rows": len(rows), "hole": _hole(samples)}
    text = json.dumps(head, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    return len(text).to_bytes(4, "little") + text + rows.astype("<f4").tobytes()


def _curves(samples: dict[str, Vector], times: Vector, facts: SceneFacts) -> Vector:
    """Return the values of `CURVES`, shape (n, curves); as in a live trace, the depth is NaN in stages that work away from the hole."""
    force = np.sqrt(sum(samples[f"force_{axis}"] ** 2 for axis in "xyz"))
    counted = [CATALOGUE.stage_number(stage) for stage in CATALOGUE.counted]
    depth = np.where(np.isin(samples["stage"], counted), facts.job.hole.centre[2] - samples["tip_z"], np.nan)
    theta = np.where(samples["width"] <= facts.widest, samples["theta"], np.nan)
    x, y, stage, width, switch = (samples[name] for name in ("tip_x", "tip_y", "stage", "width", "switch"))
    return np.column_stack([times, force, depth, x, y, theta, stage, width, switch])


def _hole(samples: dict[str, Vector]) -> list[float] | None:
    """Return x and y of the hole's mouth, m: the true place if simulated, else the tip's when the switch first closed; None without both."""
    closed = np.flatnonzero(samples["switch"] == 1.0)
    for name, scans in (("true_hole", np.flatnonzero(np.isfinite(samples["true_hole_x"]))), ("tip", closed)):
        if scans.size:
            return [round(float(samples[f"{name}_{axis}"][scans[0]]), 6) for axis in "xy"]
    return None
