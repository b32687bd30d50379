"""Judging the recording of a test again, without driving."""
