"""Faults of every kind at every stage of the served cell, and what becomes of arm, peg, record and production."""
