"""One concern per module; each yields diagnostics of the rules that its docstring explains."""
