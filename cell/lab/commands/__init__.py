"""Commands of the laboratory, one per module; each imports its dependencies when it runs."""
