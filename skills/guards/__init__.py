"""Checks of every scan and every setpoint, and the way to rest; they know no skill."""
