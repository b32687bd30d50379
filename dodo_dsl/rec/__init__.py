"""What people do with recordings: look inside, cut, and export to tables and data sets."""
