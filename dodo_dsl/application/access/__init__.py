"""What an application may use of its host: keys, paths and variables, checked with their values filled in."""
