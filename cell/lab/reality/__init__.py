"""Study of what an honest cell's errors cost, each alone and all together."""
