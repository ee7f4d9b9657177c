"""Study of the time that questions about many runs take."""
