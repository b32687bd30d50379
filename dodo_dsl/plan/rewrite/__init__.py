"""A test's own copy of the application's compose file."""
