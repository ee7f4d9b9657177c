"""Skills for pegs with corners: search with a corner, drop in, bring upright."""
