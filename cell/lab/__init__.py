"""Laboratory: simulated trials, studies and the demo. It uses the product; the product must not import it."""
