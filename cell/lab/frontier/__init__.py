"""Study of speed against accuracy."""
