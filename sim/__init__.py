"""Simulated devices for every hardware device, behind the same protocols and driven by one MuJoCo world."""
