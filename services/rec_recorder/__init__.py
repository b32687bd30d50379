"""Records the bus; tests with cameras have their pictures encoded, too."""

LIBRARIES = ("av", "services.rec_recorder.pictures")
