"""Study of reading the peg's angle from the taxels."""
