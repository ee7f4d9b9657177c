"""Search for a recipe that fulfils a wish for time, force and success."""
