"""Recordings (``.rec``): read, indexed, written."""
