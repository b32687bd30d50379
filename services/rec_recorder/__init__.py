"""Records the bus; tests with cameras have their pictures encoded, too."""
