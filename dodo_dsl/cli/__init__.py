"""The command line: a module a command, each with ``add`` (its flags) and ``main`` (its work)."""
