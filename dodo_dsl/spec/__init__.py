"""What was written: specs, manifests and deployments, read with positions and checked against their schemas."""
