"""Physics of version 0.2.0 as a speed reference: its models, and the number of steps in a simulated second of a trial."""

import time
from pathlib import Path

import mujoco

from drivers.part.round import Round
from sim.contact import shapes

STEPS = {("held", "far"): 751, ("held", "near"): 401, ("free", "free"): 187}
"""Steps of `mj_step` in a simulated second, by model and keyframe."""
FROM_EACH = 5
"""Number of steps from a keyframe before the state returns to it."""


def model(name: str) -> mujoco.MjModel:
    """Return a model: "held" is an arm with a peg in its hand, "free" a peg in the rack; contacts are those of the program."""
    shapes.install(Round(0.008))
    return mujoco.MjModel.from_xml_string(Path(__file__).with_name(f"reference_{name}.xml").read_text(encoding="utf-8"))


def bare_second() -> float:
    """Return the processor time of the steps of a simulated second, s."""
    spent = 0.0
    for (name, key), steps in STEPS.items():
        stepped = model(name)
        data, frame = mujoco.MjData(stepped), int(stepped.key(key).id)
        started = time.thread_time()
        for _ in range(steps // FROM_EACH):
            mujoco.mj_resetDataKeyframe(stepped, data, frame)
            mujoco.mj_step(stepped, data, FROM_EACH)
        spent += time.thread_time() - started
    return spent
