"""The page of a report: the run at a glance."""
