"""``dodo compile``."""
