"""The laboratory: simulated trials, studies and the demo; it uses the product, and the product never imports it."""
