"""Pictures and films of a run on record."""
