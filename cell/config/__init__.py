"""Reads the config files of a cell, checks them, and refuses what cannot be built or is not stable."""
