"""Search, insertion and adjustment with the printed equations of [gibbons]; the key `paper.skills` selects them."""
