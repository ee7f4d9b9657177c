"""Study of the simulation's speed."""
