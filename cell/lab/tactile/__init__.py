"""Study of the estimation of the peg's angle from the taxels."""
