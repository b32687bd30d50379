"""Rigs: exclusive access, checks, quarantine, camera."""
