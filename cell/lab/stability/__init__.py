"""Study of the stability limits of the loop through the skin."""
