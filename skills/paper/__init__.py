"""Search, insertion and adjustment as [gibbons] prints them: recipes with the paper's equations, chosen by the key `paper.skills`."""
