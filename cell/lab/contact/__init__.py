"""Study of models of contact: their speed, their accuracy, and where each fails."""
