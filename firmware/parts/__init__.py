"""Printed parts of the rig, from its firmware's constants; scripts/make-rig-parts writes them."""
