"""Cross-sections of parts and of their holes, each of which answers what other code would ask with `if`."""
