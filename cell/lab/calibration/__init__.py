"""The study of what calibrating the arm brings: whether its figures are true, and the first peg with and without them."""
