"""Faults of devices as data: each changes the readings of a device, its commands or its wire, until its repair."""

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from itertools import count
from typing import Any

import numpy as np

from drivers.errors import ArmReflexError, ArmSilentError, ArmStoppedError, CellError, GripperSilentError
from drivers.frames import UP, rotation_about
from drivers.quantities import Pose, SwitchState, Wrench
from drivers.skin.health import Counts
from sim.boards.faulty import Change, kept
from sim.config import WireFaults

AGES = 1e6
"""End time of a permanent fault of a wire, s."""
FULL_SCALE = 42_000
"""Reading of a saturated taxel, counts."""
LOOSE = tuple((0.4 * number, 0.4 * number + 0.2) for number in range(100))
"""Spans without contact of a loose plug, s."""


def raises(error: CellError) -> Change:
    """Return a change that raises `error` instead of returning a reading."""

    def change(reading: Any) -> Any:
        raise error

    return change


def edited(**edits: Change) -> Change:
    """Return a change of single fields of each reading, by their names."""
    return lambda reading: replace(reading, **{name: edit(getattr(reading, name)) for name, edit in edits.items()})


def behind(number: int) -> Change:
    """Return a change that delays each reading by `number` reads."""
    last: deque[Any] = deque(maxlen=number + 1)

    def change(reading: Any) -> Any:
        last.append(reading)
        return last[0]

    return change


def counted(edit: Callable[[Any, int], Any]) -> Change:
    """Return a change by a function of each reading and the number of the reading since the fault."""
    numbers = count()
    return lambda reading: edit(reading, next(numbers))


def force(edit: Change) -> Change:
    """Change the force of each state of an arm."""
    return edited(wrench=lambda wrench: replace(wrench, force=edit(wrench.force)))


def tcp(edit: Change) -> Change:
    """Change the position of the hand in each state of an arm."""
    return edited(tcp=lambda pose: replace(pose, position=edit(pose.position)))


def taxels(edit: Callable[[Any], Any]) -> Change:
    """Change all taxels, counts, within the range of the converter."""

    def change(counts: Counts) -> Any:
        return np.clip(edit(counts.astype(np.int64)), 0, FULL_SCALE + 990).astype(counts.dtype)

    return change


def noise(size: float) -> Change:
    """Add noise of this standard deviation."""
    rng = np.random.default_rng(0)
    return lambda values: values + rng.normal(0.0, size, values.shape)


def filled(value: int) -> Change:
    """Return one value, counts, with the noise of a live converter, in all taxels."""
    rng = np.random.default_rng(0)
    return taxels(lambda counts: value + rng.integers(-3, 4, counts.shape))


def at_random() -> Change:
    """Return random readings between zero and full scale."""
    rng = np.random.default_rng(0)
    return lambda counts: rng.integers(0, FULL_SCALE, counts.shape).astype(counts.dtype)


def turned(pose: Pose) -> Pose:
    """Turn an orientation by 0.2 rad about the vertical."""
    return replace(pose, rotation=rotation_about(UP, 0.2) @ pose.rotation)


def _put(index: Any, value: float) -> Change:
    """Set some elements of an array."""

    def edit(values: Any) -> Any:
        changed = values.copy()
        changed[index] = value
        return changed

    return edit


def _add(*by: float) -> Change:
    return lambda values: values + np.array(by if len(by) > 1 else by[0])


OPEN, CLOSED = SwitchState.OPEN, SwitchState.CLOSED
NAN, FINGER, MODULE = math.nan, np.s_[:1], np.s_[:1, :10]

WIRES: Mapping[str, WireFaults] = {
    "unplugged": WireFaults(unplugged=((0.0, AGES),)),
    "frames lost": WireFaults(drop=0.5),
    "frames corrupt": WireFaults(corrupt=0.5),
    "frames late": WireFaults(delay=0.5),
    "a frame in twenty lost": WireFaults(drop=0.05),
    "a frame in fifty corrupt": WireFaults(corrupt=0.02),
    "frames a tenth of a second late": WireFaults(delay=0.1),
    "plug loose": WireFaults(unplugged=LOOSE),
    "board restarts": WireFaults(resets=(0.1,)),
}
"""Faults of the wires of both boards; times from the start of the fault."""

SKIN: Mapping[str, Callable[[], Change]] = {
    "frozen": kept,
    "zero": lambda: filled(0),
    "saturated": lambda: filled(FULL_SCALE + 990),
    "stuck below the rail": lambda: filled(FULL_SCALE),
    "offset": lambda: taxels(lambda counts: counts + np.array([[4000], [0]])),
    "modules swapped": lambda: lambda counts: np.roll(counts, counts.shape[1] // 2, axis=1),
    "fingers swapped": lambda: lambda counts: counts[::-1].copy(),
    "random": at_random,
    "one finger zero": lambda: taxels(_put(FINGER, 0)),
    "one finger random": lambda: lambda counts: np.concatenate([at_random()(counts)[:1], counts[1:]]),
    "one module saturated": lambda: taxels(_put(MODULE, FULL_SCALE)),
    "three taxels dead": lambda: taxels(_put(np.s_[:, 3:6], 0)),
    "taxels in another order": lambda: lambda counts: counts[:, np.random.default_rng(0).permutation(counts.shape[1])],
    "half as sensitive": lambda: taxels(lambda counts: counts // 2),
    "twice as sensitive": lambda: taxels(lambda counts: 2 * counts),
    "drifting": lambda: counted(lambda counts, number: taxels(_add(20 * number))(counts)),
    "noisy": lambda: taxels(noise(2000.0)),
    "ten frames late": partial(behind, 10),
    "coarse": lambda: taxels(lambda counts: counts // 1024 * 1024),
    "high bits lost": lambda: taxels(lambda counts: counts % 4096),
    "turned round": lambda: taxels(lambda counts: FULL_SCALE - counts),
}
"""Faults of the taxels."""

SWITCH: Mapping[str, Callable[[], Change]] = {
    "never": lambda: lambda state: OPEN,
    "always": lambda: lambda state: CLOSED,
    "flapping": lambda: counted(lambda state, number: (OPEN, CLOSED)[number % 2]),
    "the other way round": lambda: lambda state: {OPEN: CLOSED, CLOSED: OPEN}.get(state, state),
    "closed for a moment": lambda: counted(lambda state, number: CLOSED if number < 30 else state),
    "unknown": lambda: lambda state: SwitchState.UNKNOWN,
    "frozen": kept,
    "a second late": partial(behind, 100),
}
"""Faults of the switch."""

ARM: Mapping[str, Callable[[], Change]] = {
    "reflex": lambda: raises(ArmReflexError("arm: reflex: joint 4 above its torque limit")),
    "stopped": lambda: raises(ArmStoppedError("arm: protective stop")),
    "silent": lambda: raises(ArmSilentError("arm: newest state 0.5 s old > 0.1 s limit")),
    "states late": kept,
    "wrench no number": lambda: edited(wrench=lambda wrench: Wrench(np.full(3, NAN), np.full(3, NAN))),
    "joint no number": lambda: edited(q=_put(3, NAN)),
    "stamp no number": lambda: edited(stamp=lambda stamp: NAN),
    "force beyond any sensor": lambda: force(lambda values: np.full(3, 1e308)),
    "readings still": lambda: kept("q", "dq", "tcp", "wrench", "elbow", "commanded", "unexplained"),
    "wrench offset": lambda: force(_add(0.0, 0.0, 15.0)),
    "force zero": lambda: force(np.zeros_like),
    "wrench still": lambda: kept("wrench"),
    "force doubled": lambda: force(lambda values: 2.0 * values),
    "force of the other sign": lambda: force(lambda values: -values),
    "force noisy": lambda: force(noise(3.0)),
    "force infinite": lambda: force(_put(2, math.inf)),
    "torque no number": lambda: edited(wrench=lambda wrench: replace(wrench, torque=np.full(3, NAN))),
    "place no number": lambda: tcp(_put(0, NAN)),
    "place 1 mm off": lambda: tcp(_add(0.001, 0.0, 0.0)),
    "place 20 mm off": lambda: tcp(_add(0.02, 0.0, 0.0)),
    "place 5 mm low": lambda: tcp(_add(0.0, 0.0, -0.005)),
    "place drifts": lambda: counted(lambda state, number: tcp(_add(0.0, 0.0, 2e-5 * number))(state)),
    "hand turned": lambda: edited(tcp=turned),
    "a joint 0.1 rad off": lambda: edited(q=_add(0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0)),
    "a joint out of this world": lambda: edited(q=_put(1, 1e6)),
    "velocities zero": lambda: edited(dq=np.zeros_like),
    "a velocity no number": lambda: edited(dq=_put(1, NAN)),
    "clock a second back": lambda: edited(stamp=lambda stamp: stamp - 1.0),
    "clock a second ahead": lambda: edited(stamp=lambda stamp: stamp + 1.0),
    "states five late": partial(behind, 5),
    "setpoint of no age": lambda: edited(setpoint_age=lambda age: NAN),
    "no setpoint held": lambda: edited(setpoint_age=lambda age: math.inf),
}
"""Faults of the arm's states."""

HAND: Mapping[str, Callable[[], Change]] = {
    "silent": lambda: raises(GripperSilentError("gripper: newest state 1.0 s old > 0.5 s limit")),
    "frozen": kept,
    "width no number": lambda: edited(width=lambda width: NAN),
    "width 5 mm off": lambda: edited(width=lambda width: width + 0.005),
    "width zero": lambda: edited(width=lambda width: 0.0),
    "reports no grip": lambda: edited(is_gripping=lambda is_gripping: False),
    "reports a grip": lambda: edited(is_gripping=lambda is_gripping: True),
    "reports motion": lambda: edited(is_moving=lambda is_moving: True),
    "half a second late": partial(behind, 50),
}
"""Faults of the hand's states."""

LOST: Mapping[str, tuple[str, Callable[[], Callable[[str], bool]]]] = {
    "arm: deaf": ("arm", lambda: lambda command: command != "follow"),
    "arm: every second setpoint lost": ("arm", lambda: _some(lambda number: number % 2 == 0)),
    "arm: deaf for a moment": ("arm", lambda: _some(lambda number: number >= 5)),
    "hand: stuck": ("gripper", lambda: lambda command: command not in ("grip", "release")),
    "hand: does not close": ("gripper", lambda: lambda command: command != "grip"),
    "hand: does not open": ("gripper", lambda: lambda command: command != "release"),
}
"""Commands that do not reach a device."""


def _some(arrives: Callable[[int], bool]) -> Callable[[str], bool]:
    """Return a function that loses setpoints, depending on their number since the fault."""
    numbers = count()
    return lambda command: command != "follow" or arrives(next(numbers))
