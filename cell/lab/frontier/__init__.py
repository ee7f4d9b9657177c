"""Study of speed against accuracy, for several methods of insertion."""
