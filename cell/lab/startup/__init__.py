"""Study of how long a command takes before it does anything."""
