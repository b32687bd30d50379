"""Rules about the files that tests name: what is in them, and what of it is named."""
