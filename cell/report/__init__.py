"""Summary of many recorded runs: facts, drawings and documents."""
