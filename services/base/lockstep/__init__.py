"""A service's part in lockstep."""
