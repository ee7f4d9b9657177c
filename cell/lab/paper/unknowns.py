"""What [gibbons] does not print, and between which bounds it is searched."""

from dataclasses import dataclass

from cell.lab.published import PUBLISHED

SEARCH, INSERT, ADJUST = (stage.name for stage in PUBLISHED)


@dataclass(frozen=True, slots=True)
class Unknown:
    """One figure that [gibbons] does not print."""

    key: str
    stage: str
    """Stage in whose round it is searched."""
    low: float
    high: float
    by_hand: float
    """Figure found by hand, or by an earlier fit on the same half of the seeds, from which the search begins."""
    bounds: str
    """Reason for the bounds."""
    is_world: bool = False
    """Whether it describes the laboratory and not the method."""


UNKNOWNS: tuple[Unknown, ...] = (
    Unknown("search.speed", SEARCH, 0.07, 0.1, 0.084, "published time over the area at passes of about a hole's width"),
    Unknown("search.pitch", SEARCH, 0.8, 1.2, 1.18, "half a peg to the width over which a leaning peg falls in"),
    Unknown("search.push_stiffness", SEARCH, 1100.0, 1700.0, 1170.0, "11 to 17 N at the printed offset of 10 mm"),
    Unknown(
        "search.gains.translation",
        SEARCH,
        500.0,
        1200.0,
        1150.0,
        "an arm that follows its path, to one that does not fall into the hole",
    ),
    Unknown(
        "search.event.threshold",
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
    Unknown("insert.gains.translation", INSERT, 400.0, 1500.0, 800.0, "soft enough for an end point that errs by 5 mm"),
    Unknown(
        "insert.gains.rotation",
        INSERT,
        0.7,
        6.0,
        1.5,
        "a hand that friction stops at once to one that it stops at the end",
    ),
    Unknown("insert.integral_gain", INSERT, 0.06, 0.15, 0.09, "a minute to some seconds to make up for friction"),
    Unknown(
        "adjust.gains.rotation",
        ADJUST,
        4.0,
        16.0,
        8.0,
        "a hand that friction holds still, to one that follows the spiral without a lag",
    ),
    Unknown("adjust.push_stiffness", ADJUST, 600.0, 1500.0, 1000.0, "6 to 15 N"),
    Unknown(
        "adjust.turn_rate", ADJUST, 3.0, 10.0, 6.28, "turns of the spiral 0.8 to 2.6 mm apart, at its printed growth"
    ),
)
"""Figures that are searched. Joint friction, gravity, grip force and the like are drawn for each trial by `reality.scale=1`."""

ONE_BOARD = ("sim.fixture.mean=[0.5,0.0]",)
"""The task board of [gibbons] stayed where it was, and starts were drawn from the area about the hole, [x_h - D, x_h + D]: the hole is in the middle."""
ONE_ARM = ("world=v1", "reality.scale=1", 'reality.without=["arm.sigmoid_friction"]', *ONE_BOARD)
"""Honest errors on a board that is not moved and an arm whose joints hold still: the authors had one arm, of one law of friction. With a hand as
soft as theirs may be, joints of the smooth law are aligned in 2 to 4 s and dry ones in 12 to 25 s; 24.1 s are published. The figures
were found in the first version of the world."""
LABORATORY: dict[str, float] = {"grip.friction": 0.756, "contact.friction": 0.11, "skin.noise": 0.000874}
"""Pads, plate and skin with which the method does what it did in life; its own figures stand in the preset. Source: `cell study paper`, see
docs/results.md.
"""


def by_hand() -> dict[str, float]:
    """Return the figures found by hand, by key."""
    return {unknown.key: unknown.by_hand for unknown in UNKNOWNS}


def of_stage(stage: str) -> list[Unknown]:
    """Return the figures that are searched in the round of a stage."""
    return [unknown for unknown in UNKNOWNS if unknown.stage == stage]
