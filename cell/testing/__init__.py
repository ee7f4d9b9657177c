"""Serves a simulated cell to the tests of other people's PLC programs."""
