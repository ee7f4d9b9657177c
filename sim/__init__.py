"""Simulated devices that stand in for every real one, behind the same protocols, driven by one MuJoCo world."""
