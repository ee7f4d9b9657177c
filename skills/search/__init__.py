"""The parts of the search for the hole: its parameters, its course, its phases, what is felt on the way, and the sweep."""
