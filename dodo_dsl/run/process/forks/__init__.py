"""Processes that are forked instead of started: the fork server, and how a runner speaks to it."""
