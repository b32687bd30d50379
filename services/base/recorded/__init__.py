"""Tests that are judged again: services get what a recording holds, in the time of the test."""
