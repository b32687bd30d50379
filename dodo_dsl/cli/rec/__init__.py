"""``dodo rec``."""
