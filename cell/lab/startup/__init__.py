"""Study of the time that a command takes to start."""
