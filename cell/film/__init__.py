"""Pictures and films of a recorded run."""
