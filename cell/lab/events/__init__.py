"""Study of hole events, false and true."""
