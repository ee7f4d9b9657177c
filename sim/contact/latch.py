"""Force of a latch near the bottom of the hole on the peg's end, compiled: a detent, or a light press fit.

The force acts on the centre of the peg's end along the hole's axis and depends on the depth alone. The normalised depth
x is 0 at the start of the latch and 1 at the bottom:

- detent: F sin(2 pi x), the slope of the energy F h (1 - cos(2 pi x)) / (2 pi), so that the work up to the crest is
  returned after it. It models both ramps of a snap-fit, whose force rises with its deflection: the mating force W = P
  (mu + tan a) / (1 - mu tan a), [bayer], without friction.
- press fit: up to F x against the motion, in proportion to the pressed length, as friction under uniform pressure [you].
  The fit acts as a spring until it slides, so that its force needs no division by a speed.

Forces of 5 to 20 N are those of light latches; a plug of a data network takes up to 30 N (IEC 60512-13-1).
"""

import math

import numpy as np

from drivers.compiled import njit
from drivers.parts import Latch
from drivers.quantities import Vector
from sim.contact.peg_distances import PegView, below_mouth
from sim.contact.plate import Plate

KINDS = {"detent": 1.0, "press": 2.0}
"""Number of each kind of latch; 0 is none."""
KIND, FORCE, TOP, HEIGHT, REACH, STUCK = 0, 1, 2, 3, 4, 5
"""Indices of single words: kind; largest force, N; depth at the start of the latch, and length of the latch, m; distance
from the hole's axis within which the peg's end is in the hole, m; depth at which a press fit sticks, m."""
MOUTH, AXES, APPLIED = 6, 9, 18
"""Indices of several words: centre of the hole's mouth, three, m; axes of the plate, nine; force, N, and torque, N·m, on
the peg's centre of mass in the last step, six."""
WORDS = 24


def words_of(latch: Latch | None, plate: Plate, bottom: float, force: float, place: float) -> Vector:
    """Return the words of a latch without contact, shape (WORDS,).

    Args:
        latch: The latch stated in the job; None for a hole without one.
        plate: The true plate.
        bottom: Depth of the bottom to which the latch's position refers, m.
        force: True force divided by the stated force, ratio.
        place: Height of the true latch above the stated one, m.
    """
    words = np.zeros(WORDS)
    if latch is None:
        return words
    words[KIND], words[FORCE] = KINDS[latch.kind], latch.force * force
    words[TOP], words[HEIGHT] = bottom - latch.height - place, latch.height
    words[REACH] = min(plate.half)
    words[MOUTH : MOUTH + 3], words[AXES : AXES + 9] = plate.position, plate.rotation.ravel()
    return words


def loosen(words: Vector) -> None:
    """Reset the memory of applied forces after the load has been cleared, for example if the peg becomes another body."""
    words[APPLIED : APPLIED + 6] = 0.0


@njit(cache=True, inline="always")
def act(words: Vector, peg: PegView, mass_centre: Vector, load: Vector) -> None:  # pragma: no cover
    """Add the latch's force and torque on the peg in the coming step to the load.

    Args:
        words: The latch; updated.
        peg: Size and pose of the peg.
        mass_centre: View of the peg's centre of mass, shape (3,), m, base frame.
        load: View of force, N, and torque, N·m, at that point, shape (6,), base frame; other contributions stay.
    """
    plate = words[AXES : AXES + 9].reshape(3, 3)
    depth, beside = below_mouth(peg.size[1], peg.middle, peg.axes, words[MOUTH : MOUTH + 3], plate)
    resisting = resistance(words, depth) if beside < words[REACH] else 0.0
    # f = F n along the plate's normal; torque = r × f, with r from the centre of mass to the centre of the peg's end.
    f = (resisting * plate[0, 2], resisting * plate[1, 2], resisting * plate[2, 2])
    r = (
        peg.middle[0] - peg.size[1] * peg.axes[0, 2] - mass_centre[0],
        peg.middle[1] - peg.size[1] * peg.axes[1, 2] - mass_centre[1],
        peg.middle[2] - peg.size[1] * peg.axes[2, 2] - mass_centre[2],
    )
    torque = (r[1] * f[2] - r[2] * f[1], r[2] * f[0] - r[0] * f[2], r[0] * f[1] - r[1] * f[0])
    for i in range(3):
        load[i] += f[i] - words[APPLIED + i]
        load[3 + i] += torque[i] - words[APPLIED + 3 + i]
        words[APPLIED + i], words[APPLIED + 3 + i] = f[i], torque[i]


@njit(cache=True, inline="always")
def resistance(words: Vector, depth: float) -> float:  # pragma: no cover
    """Return the force on the peg's end at `depth`, m: N, positive out of the hole. Update the sticking depth of a press fit."""
    # Stiffness of a press fit before it slides, N/m; assumed equal to the pads' shear, which the same steps resolve.
    press_stiffness = 5e4
    # x = (depth - top) / height.
    way = (depth - words[TOP]) / words[HEIGHT]
    if words[KIND] == 1.0:
        return words[FORCE] * math.sin(2.0 * math.pi * way) if 0.0 < way < 1.0 else 0.0
    most = words[FORCE] * min(max(way, 0.0), 1.0)
    # Detent, above: F sin(2 pi x). Press fit: k (depth - s); the sticking depth s follows if |k (depth - s)| > F x.
    slack = most / press_stiffness
    words[STUCK] = min(max(words[STUCK], depth - slack), depth + slack)
    pressed: float = press_stiffness * (depth - words[STUCK])
    return pressed


@njit(cache=True, inline="always")
def add_felt(words: Vector, peg: PegView, pivot: Vector, force: Vector, torque: Vector) -> None:  # pragma: no cover
    """Add the latch's force, N, and its torque about the pivot, N·m, to the wrench of the plates on the peg."""
    f0, f1, f2 = words[APPLIED], words[APPLIED + 1], words[APPLIED + 2]
    r0 = peg.middle[0] - peg.size[1] * peg.axes[0, 2] - pivot[0]
    r1 = peg.middle[1] - peg.size[1] * peg.axes[1, 2] - pivot[1]
    r2 = peg.middle[2] - peg.size[1] * peg.axes[2, 2] - pivot[2]
    force[0] += f0
    force[1] += f1
    force[2] += f2
    torque[0] += r1 * f2 - r2 * f1
    torque[1] += r2 * f0 - r0 * f2
    torque[2] += r0 * f1 - r1 * f0
