"""Plans as files: compose layers, child pipeline and ``test.json``; written at once or compared with what stands."""
