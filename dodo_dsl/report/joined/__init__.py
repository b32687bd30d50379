"""Several reports as one: their files, copied below one folder."""
