"""Files that tests name, such as maps, truths and targets: read by services, and checked by the same code before."""
