"""The laboratory's commands, one a module; each imports what it needs when it is run."""
