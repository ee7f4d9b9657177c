"""Study of models of contact: how fast, how exact, where each fails."""
