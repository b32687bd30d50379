"""The application under test: its compose files, read with positions, merged as compose does, and checked."""
