"""``dodo run``."""
