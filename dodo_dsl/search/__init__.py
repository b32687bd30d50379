"""Searches for the conditions under which a test fails: where to look, what was found, and what it means."""
