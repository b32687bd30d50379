"""The command ``dodo stats``."""
