"""Measures skin, arm and places, by touch or by hand, and writes the lines of the config."""
