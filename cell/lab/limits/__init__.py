"""Study of what limits each phase of an insertion."""
