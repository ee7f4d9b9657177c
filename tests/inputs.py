"""Number of random inputs at a boundary; `INPUTS=100000 python -m pytest FILE` sets it to 100000."""

import os


def inputs(quick: int) -> int:
    """Return the number that the environment states, else `quick`."""
    return int(os.environ.get("INPUTS", quick))


KEPT = {
    "part-sim.json": b'{"place":"RACK","evidence":"","is_held":false,"depth":0.0,"tip":[0,0,0],"emptied":0}',
    "learned.json": b'{"version":1,"places":{"1":{"job":"0a","mean":[0.5,0.0],"variance":[1e-6,1e-6],"scatter":[1e-6,1e-6],"parts":3,"stray":null,"updated":"2026-01-01T00:00:00Z"}}}',
    "proven.json": b'{"facts":{"load":{"date":"2026-01-01","measured":"0.2 kg","devices":"fr3 1","of":"0a1b"}}}',
    "page-token": b"0123456789abcdefghijklmn",
}
"""Content of each file that a cell keeps beside its journal."""
