"""One rule a module; each yields diagnostics under the names that its docstring explains."""
