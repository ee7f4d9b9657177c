"""Stand-ins for every device, behind the same protocols, driven by one MuJoCo world."""
