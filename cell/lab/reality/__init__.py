"""Study of the cost of a cell's errors, each alone and all combined."""
