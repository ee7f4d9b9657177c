"""Study of how fast the stand-in runs."""
