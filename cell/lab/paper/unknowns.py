"""Figures that [gibbons] does not print, and the bounds of their search."""

from dataclasses import dataclass

from cell.lab.published import PUBLISHED

SEARCH, INSERT, ADJUST = (stage.name for stage in PUBLISHED)


@dataclass(frozen=True, slots=True)
class Unknown:
    """One figure that [gibbons] does not print."""

    key: str
    stage: str
    """Stage whose round searches it."""
    low: float
    high: float
    by_hand: float
    """Initial figure of the search, found by hand or by an earlier fit on the same half of the seeds."""
    bounds: str
    """Reason for the bounds."""
    is_world: bool = False
    """True if it describes the laboratory and not the method."""


UNKNOWNS: tuple[Unknown, ...] = (
    Unknown(
        "paper.search.speed", SEARCH, 0.07, 0.1, 0.084, "published time over the area at passes of about a hole's width"
    ),
    Unknown("paper.search.pitch", SEARCH, 0.8, 1.2, 1.18, "half a peg to the width over which a leaning peg falls in"),
    Unknown("paper.search.push_stiffness", SEARCH, 1100.0, 1700.0, 1170.0, "11 to 17 N at the printed offset of 10 mm"),
    Unknown(
        "paper.search.gains.translation",
        SEARCH,
        500.0,
        1200.0,
        1150.0,
        "an arm that follows its path, to one that does not fall into the hole",
    ),
    Unknown(
        "paper.search.threshold",
        SEARCH,
        0.095,
        0.13,
        0.105,
        "what a peg that turns does to the average, to what a wall does",
    ),
    Unknown("image.threshold", SEARCH, 0.25, 0.4, 0.305, "background left in the image to a part of the print lost"),
    Unknown("grip.friction", SEARCH, 0.6, 1.0, 0.916, "rubber on metal; it prevented sliding in life", is_world=True),
    Unknown("contact.friction", SEARCH, 0.1, 0.2, 0.133, "metal on metal, greased", is_world=True),
    Unknown(
        "skin.noise",
        SEARCH,
        0.0005,
        0.002,
        0.00107,
        "[cyskin]: about 1 count on a quiet patch, 87 in the median of all; 20 000 are a touch",
        is_world=True,
    ),
    Unknown(
        "paper.insert.gains.translation", INSERT, 400.0, 1500.0, 800.0, "soft enough for an end point that errs by 5 mm"
    ),
    Unknown(
        "paper.insert.gains.rotation",
        INSERT,
        0.7,
        6.0,
        1.5,
        "a hand that friction stops at once to one that it stops at the end",
    ),
    Unknown("paper.insert.integral_gain", INSERT, 0.06, 0.15, 0.09, "a minute to some seconds to make up for friction"),
    Unknown(
        "paper.adjust.gains.rotation",
        ADJUST,
        4.0,
        16.0,
        8.0,
        "a hand that friction holds still, to one that follows the spiral without a lag",
    ),
    Unknown("paper.adjust.push_stiffness", ADJUST, 600.0, 1500.0, 1000.0, "6 to 15 N"),
    Unknown(
        "paper.adjust.turn_rate",
        ADJUST,
        3.0,
        10.0,
        6.28,
        "turns of the spiral 0.8 to 2.6 mm apart, at its printed growth",
    ),
)
"""Figures of the search. Each trial draws joint friction, gravity, grip force and similar errors with
`reality.scale=1`."""

ONE_BOARD = ("sim.fixture.mean=[0.5,0.0]",)
"""The task board of [gibbons] stayed in place, and starts were drawn from the area around the hole, [x_h - D, x_h + D].
The hole is therefore at the centre."""
ONE_ARM = ("world=v1", "reality.scale=1", 'reality.without=["arm.sigmoid_friction"]', *ONE_BOARD)
"""Honest errors on a fixed board and an arm with dry joint friction: the authors had one arm with one friction law.
With a hand as soft as theirs, alignment takes 2 to 4 s with joints of the smooth law and 12 to 25 s with dry ones; 24.1
s are published. The figures come from the first version of the world."""
LABORATORY: dict[str, float] = {"grip.friction": 0.756, "contact.friction": 0.11, "skin.noise": 0.000874}
"""Pads, plate and skin that reproduce the published experiment; the method's own figures are in the preset. Source:
`cell study paper`, see docs/results.md."""


def by_hand() -> dict[str, float]:
    """Return the figures found by hand, by key."""
    return {unknown.key: unknown.by_hand for unknown in UNKNOWNS}


def of_stage(stage: str) -> list[Unknown]:
    """Return the figures searched in the round of a stage."""
    return [unknown for unknown in UNKNOWNS if unknown.stage == stage]
