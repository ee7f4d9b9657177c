"""Study of margins: the size of each error at which a method fails."""
