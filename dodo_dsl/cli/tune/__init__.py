"""``dodo tune``."""
