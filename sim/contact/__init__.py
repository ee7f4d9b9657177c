"""Contacts of peg, hole and plates in closed form, and the shapes of the plate."""
