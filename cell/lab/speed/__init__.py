"""Speed of trials, scans, requests and starts: figures that are stored and guarded, and a profile of a scan."""
