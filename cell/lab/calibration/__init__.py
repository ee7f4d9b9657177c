"""Study of arm calibration: accuracy of its figures, and the first peg with and without them."""
