"""The language server: what ``dodo compile --check`` finds, in an editor."""
