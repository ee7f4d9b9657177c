"""The product's commands, one module each; each imports its dependencies when it runs."""
