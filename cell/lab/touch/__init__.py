"""The study of what touch is worth: each preset and a regime of turning pegs, beside the same hand gone blind."""
