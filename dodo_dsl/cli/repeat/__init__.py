"""What is noted of a run, so that it can be repeated."""
