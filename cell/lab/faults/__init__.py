"""Faults of every kind at every stage of the served cell, and their effect on arm, peg, record and production."""
