"""Cross-sections of pegs and holes; each answers what other code would otherwise decide by shape."""
