"""Evidence that the peg is seated: the switch, the depth, or the force of a latch."""
