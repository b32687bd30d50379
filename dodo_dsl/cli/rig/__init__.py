"""``dodo rig``."""
