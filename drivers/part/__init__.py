"""Cross-sections of pegs and holes; each provides the properties that other code would otherwise derive from the shape."""
