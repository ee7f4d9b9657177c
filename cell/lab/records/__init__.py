"""Study of the duration of queries over many runs."""
