"""Physics of one cell: models, steps, drawn errors, true state."""
