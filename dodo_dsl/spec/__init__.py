"""Specs, manifests and deployments, read with positions and checked against their schemas."""
