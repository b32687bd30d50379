"""Plans as files: compose layers, child pipeline and ``test.json``; written, or compared with existing files."""
