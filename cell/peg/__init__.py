"""Decides where the peg is, and whether an insertion has succeeded."""
