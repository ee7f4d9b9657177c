"""The way from taxels to the pose of the peg in the hand and to the hole event; no I/O."""
