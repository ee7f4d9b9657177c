"""Tables of the simulation's speed."""

from collections.abc import Sequence

from rich.table import Table

from cell.lab.speed.measure import ProfileLine, SpeedLine


def speed(lines: Sequence[SpeedLine]) -> Table:
    """Return the simulation's speed in each regime."""
    table = Table("regime", "simulated (s)", "x real time", "bare mj_step (1/s)", "(x)", "outside mj_step (us/ms)")
    for line in lines:
        table.add_row(
            line.regime,
            f"{line.simulated:.1f}",
            f"{line.real_time:.1f}",
            f"{line.bare_rate:.0f}",
            f"{line.bare_real_time:.1f}",
            f"{line.outside * 1e6:.1f}",
        )
    return table


def profile(lines: Sequence[ProfileLine]) -> Table:
    """Return the profile of a trial."""
    table = Table("part", "cost (us/ms)", "share (%)")
    for line in lines:
        table.add_row(line.part, f"{line.cost * 1e6:.2f}", f"{line.share * 100:.1f}")
    return table
