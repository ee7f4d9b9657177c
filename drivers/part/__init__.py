"""Cross-sections of pegs and holes; each tells the properties that other code would otherwise derive from the shape."""
