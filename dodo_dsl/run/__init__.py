"""Running Plans: sandboxes, leases, layers in order, readiness, end, verdict, outcome and teardown."""
