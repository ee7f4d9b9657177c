"""Study of the method's rules: each one replaced by its simplest form, alone, on paired seeds."""
