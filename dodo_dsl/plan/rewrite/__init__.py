"""The copy of the application's compose file that a test has to itself."""
