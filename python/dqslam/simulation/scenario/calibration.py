"""The settings of what an estimator is told wrongly about its camera."""

from dqslam.simulation.scenario.settings import Positive, Settings


class CalibrationErrorSettings(Settings):
    """The camera that the estimator is given, compared with the one that took the images."""

    mount_yaw_deg: float = 0.0
    """The given camera is turned by this angle, counter-clockwise seen from above."""
    mount_pitch_deg: float = 0.0
    """The given camera is tilted down by this angle."""
    focal_length_factor: Positive = 1.0
    """Given focal length divided by the true one."""
    time_offset_s: float = 0.0
    """Images are taken later than their time stamps say, by this time."""
