"""What changed between two reports: compared as values, and shown as text and Markdown."""
