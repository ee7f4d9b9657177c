"""Cases of the study of limits: default and `fast` on pegs of every size, and settings at bounds beyond the presets."""

from dataclasses import dataclass

from cell.lab.frontier.measure import Variant

FAST = "fast"
SHIPPED, CONFIGURED = "as shipped", "as configured"
SIZES = (0.003, 0.004, 0.006, 0.008, 0.012, 0.016)
"""Diameters of the pegs, m; each hole is 0.1 mm wider."""
STATED = 0.008
"""Diameter of the peg in the charts of single phases, m."""
GAP = 1e-4
AREA = 0.06
"""Side of the area that contains the hole, m."""
SPEEDS = (0.05, 0.085, 0.15)
"""Speeds of lanes with a spacing that misses some holes, m/s; over a hole of 8.1 mm the last is the maximum."""
WIDE = ("search.pitch=0.95", "hole.area=[0.03,0.03]", "search.timeout=20")
RATES = ((0.3, 0.7), (0.8, 0.4), (1.4, 0.3))
"""Rates of rotations, rad/s, and the times to reach them, s."""


@dataclass(frozen=True, slots=True)
class Case:
    """One case: a preset on a peg, or keys for one phase."""

    variant: Variant
    label: str
    """Name of its preset, or of the keys that differ."""
    size: float = STATED
    """Diameter of the peg, m."""

    @property
    def name(self) -> str:
        """Name of the case in rows and tables."""
        return f"{self.variant.family}: {self.variant.name}"

    @property
    def is_preset(self) -> bool:
        """True for an unchanged preset."""
        return self.variant.family == "size"


def cases(is_own: bool, is_quick: bool) -> list[Case]:
    """Return all cases, or with `is_quick` those of the stated peg alone; `is_own` is True if a config or keys are given."""
    own = CONFIGURED if is_own else SHIPPED
    found = []
    for size in (STATED,) if is_quick else SIZES:
        keys: tuple[str, ...] = (f"peg.diameter={size:g}", f"hole.diameter={size + GAP:.4f}")
        keys = () if size == STATED else keys
        for label, preset in ((own, None), (FAST, FAST)):
            found.append(Case(Variant("size", f"{1e3 * size:g} mm, {label}", preset, keys), label, size))
    if is_quick:
        return found
    for speed in SPEEDS:
        label = f"lanes at {speed:g} m/s, far apart"
        found.append(Case(Variant("speed", f"{speed:g} m/s", None, (f"search.speed={speed:g}", *WIDE)), label))
    for rate, run_up in RATES:
        turned = (f"insert.turn_rate={rate:g}", f"insert.turn_run_up={run_up:g}", "hole.area=[0.01,0.01]")
        found.append(Case(Variant("turn", f"{rate:g} rad/s in {run_up:g} s", None, turned), f"{rate:g} rad/s"))
    return found
