"""The parts of the search for the hole: parameters, course, phases, contact evidence, and the sweep."""
