"""The files of the drive viewer in a report."""

PAGE, DATA = "drive.html", "drive.js"
FILES = (PAGE, DATA)
"""In the folder of each test."""
SHARED = "_viewer"
"""The folder of scripts and style for all of them; no test's folder begins with an underscore."""
LOGS = "logs"
"""The folder of the services' logs in that of a test."""
