"""The report: one file that shows what a sweep, or a training, says."""
