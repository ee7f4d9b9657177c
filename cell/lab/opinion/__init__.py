"""Study of a second opinion: whole trials on an externally described arm."""
