"""How busy the machine is while a test runs in real time, and what that means for the test's outcome."""
