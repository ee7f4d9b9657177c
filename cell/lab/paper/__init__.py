"""Study of the published method under honest errors: what [gibbons] does not print is fitted on half of the seeds."""
