"""Skills: reusable blocks that sense and move once per scan and return one typed answer."""
