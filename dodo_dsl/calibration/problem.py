"""What makes a calibration void."""


class CalibrationProblem(Exception):
    """Measurements from which nothing can be computed, or not well enough; one sentence."""
