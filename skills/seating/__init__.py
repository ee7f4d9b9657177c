"""Evidence that the peg is seated: switch, depth, or the force of a latch."""
