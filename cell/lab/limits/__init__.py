"""Study of the limits of each phase of an insertion."""
