"""Messages by name and id, and their encodings."""
