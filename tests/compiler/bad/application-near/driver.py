"""Of the case."""
