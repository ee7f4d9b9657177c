"""Speed of trials, scans, requests and starts: stored and guarded figures, and a profile of a scan."""
