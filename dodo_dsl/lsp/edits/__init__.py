"""What the editor changes in a document for its user."""
