"""Drawings and printable parts of the rig, from its firmware's constants; scripts/make-rig-drawings writes them."""
