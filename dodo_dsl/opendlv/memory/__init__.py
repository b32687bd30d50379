"""Shared memory in both of libcluon's modes, and the pixel formats of frames in it."""
