"""Study of learning: series of parts on one cell with a slightly moving fixture, replaced at the end."""
