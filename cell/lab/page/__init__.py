"""Study of the page: what it costs the scan, how fast it shows what happens, and whether anything grows."""
