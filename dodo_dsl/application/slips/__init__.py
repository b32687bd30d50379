"""What people hardly mean, though it is a compose file: variables, flags and programs that are almost right."""
