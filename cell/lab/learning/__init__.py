"""The study of learning: series of parts on one cell whose fixture moves a little, and is exchanged in the end."""
