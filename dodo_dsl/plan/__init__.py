"""Plans: the addresses, images, flags, files and the rewritten application of each test."""
