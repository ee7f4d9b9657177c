"""Pictures of the cell: a scene of its own that is posed from recorded states and that the physics never sees."""
