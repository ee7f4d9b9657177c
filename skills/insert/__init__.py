"""Skills that turn the peg upright and bring it down into the hole, and their decisions."""
