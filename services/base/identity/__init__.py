"""Who is a service of the test: its key, and who may send which message."""
