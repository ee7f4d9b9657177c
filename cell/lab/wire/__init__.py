"""Study of the wires of skin and switch."""
