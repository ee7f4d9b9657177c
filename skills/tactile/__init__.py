"""Estimation of the peg's pose in the hand from taxel frames; no I/O."""
