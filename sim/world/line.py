"""Surroundings of a simulated cell: a rack with slots, a line that exchanges workpieces, and a person who removes pegs.

A new run does not remove a dropped peg. Because the simulation has only one peg, the rack's next slot is then empty.
"""

import math

from drivers.parts import Job, Point
from drivers.protocols import Clock
from sim.world.physics import World
from sim.world.situation import PegSituation

EXCHANGE_TIME = 0.05
"""Time in which the line exchanges a workpiece, s: long enough for the switch's board to detect it."""
EXCHANGE_STEPS = 5
"""Number of clock steps in that time. An emulated board reads its lever in each step and reports it in the next."""


class SimLine:
    """The line around one simulated cell."""

    def __init__(self, world: World, clock: Clock, bin_at: Point) -> None:
        """Store the physics, the cell's clock, and the position above the reject bin, m, base frame."""
        self._world, self._clock, self._bin = world, clock, bin_at
        self._emptied: set[int] = set()
        self._is_empty = False
        self._stood = world.peg_pose().position
        self._slot = world.job.slot % world.job.rack.slots

    def stock(self, job: Job, seed: int) -> None:
        """Set up the workpiece and the peg for the run with this seed.

        The job's slot then holds a peg, unless the slot or the rack is empty. If a peg lies about, nothing is set up.
        """
        if self.lies_about():
            return
        if not self._is_in_slot():
            self._emptied.add(self._slot)
        if job.rack.refill == "feeder":
            self._emptied.clear()
        self._world.restock(job, seed)
        self._slot, self._stood = job.slot % job.rack.slots, self._world.peg_pose().position
        if self._is_empty or self._slot in self._emptied:
            self._world.lose()

    def exchange(self) -> None:
        """Remove the workpiece with the peg in its hole, as the line does after it has read the seated state."""
        if self._world.peg is PegSituation.FREE and self._world.truth().is_in_hole:
            self._emptied.add(self._slot)
            self._world.lose()
        self._let_pass()

    def refill(self) -> None:
        """Fill every slot of the rack."""
        self._emptied.clear()
        self._is_empty = False

    def empty(self) -> None:
        """Empty every slot of the rack, and the feeder, until `refill`; the next run finds no peg."""
        self._is_empty = True

    def clear(self) -> None:
        """Remove a peg that is in the hand, in the hole or dropped, as a person does."""
        if not self._is_in_slot():
            self._emptied.add(self._slot)
            self._world.lose()
        self._let_pass()

    def lies_about(self) -> bool:
        """True if the peg is in the hand, in the hole or dropped; False in its slot, in the bin or gone."""
        if self._world.peg is PegSituation.GONE or self._is_in_slot():
            return False
        return self._world.peg is PegSituation.HELD or not self._is_in_bin()

    def _let_pass(self) -> None:
        """Advance the time of an exchange; the switch reports an empty hole meanwhile."""
        for _ in range(EXCHANGE_STEPS):
            self._clock.wait_until(self._clock.now() + EXCHANGE_TIME / EXCHANGE_STEPS)

    def _is_in_slot(self) -> bool:
        if self._world.peg is not PegSituation.FREE:
            return False
        # Largest displacement of the peg's centre if the peg is still in its slot, m.
        return math.dist(self._world.peg_pose().position, self._stood) <= 2e-3

    def _is_in_bin(self) -> bool:
        # Distance from the centre of the reject bin within which a peg released above it is in the bin, m.
        return math.dist(self._world.peg_pose().position[:2], self._bin[:2]) <= 0.08
