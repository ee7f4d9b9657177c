"""Study of contact models: their speed, their accuracy, and the limits of each."""
