"""ERT readers: one board one file."""
