"""The command line: one module per command, each with ``add`` (its flags) and ``main`` (its work)."""
