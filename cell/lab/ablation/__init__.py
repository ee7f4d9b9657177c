"""Study of the method's rules: one rule at a time is replaced by its simplest form, on paired seeds."""
