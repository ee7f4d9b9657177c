"""Study of where the loop through the skin goes unstable."""
