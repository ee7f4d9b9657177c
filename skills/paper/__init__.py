"""Search, insertion and adjustment with the equations printed in [gibbons]; the key `paper.skills` selects them."""
