"""Checks of every scan and every setpoint, and braking to rest; independent of the skills."""
