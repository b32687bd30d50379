"""``dodo new``."""
