"""The files of the drive viewer in a report."""

PAGE, DATA = "drive.html", "drive.js"
SHARED = "_viewer"
"""The folder of scripts and style for all of them; no test's folder begins with an underscore."""
FAILED, FAILED_VARIABLE = "failed.js", "dodoFailed"
"""Slug, name and outcome of each test of the report that did not pass and has a page, for steps between them."""
LOGS = "logs"
"""The folder of the services' logs in that of a test."""
VIDEOS = tuple(f"camera-{number}.mp4" for number in range(4))
"""Of the cameras of a test."""
BEFORE = "before.js"
"""The way of the same test in another report, where they are compared."""
FILES = (PAGE, DATA, BEFORE, *VIDEOS)
"""In the folder of each test."""
