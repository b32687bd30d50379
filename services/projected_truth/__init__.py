"""Says where the models of a map are in the pictures of a real camera."""
