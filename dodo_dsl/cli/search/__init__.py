"""``dodo search``."""
