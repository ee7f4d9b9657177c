"""Study of the value of touch: each preset and a regime of rotating pegs, beside the same hand without touch."""
