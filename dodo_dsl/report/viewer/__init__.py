"""The drive viewer: a page a test that replays it offline, from the recording, the logs and the outcome."""
