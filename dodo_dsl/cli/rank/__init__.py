"""The command ``dodo rank``."""
