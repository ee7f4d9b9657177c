"""A simulated device for every hardware device, behind the same protocol, all driven by one MuJoCo simulation."""
