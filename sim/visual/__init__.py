"""Pictures of the cell: a separate scene, posed from recorded states and without effect on the physics."""
