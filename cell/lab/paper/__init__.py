"""Study of the published method under honest errors; figures that [gibbons] does not print are fitted on half of the seeds."""
