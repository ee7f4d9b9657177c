"""The simulated arm: drives, senses, errors, and arms from other descriptions."""
