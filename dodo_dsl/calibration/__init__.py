"""Calibration of a rig: the constants of its axes, and its camera's intrinsics."""
