"""Study of false and true hole events."""
