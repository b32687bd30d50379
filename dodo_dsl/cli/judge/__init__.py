"""The command ``dodo judge``."""
