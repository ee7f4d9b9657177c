"""The study of a second opinion: whole trials on an arm that other people described."""
