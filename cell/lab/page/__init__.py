"""Study of the page: its cost for the scan, its latency, and the growth of memory."""
