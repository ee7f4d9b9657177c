"""Study of margins: how large each error may be before a method fails."""
