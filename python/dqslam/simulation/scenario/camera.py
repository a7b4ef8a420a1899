"""The settings of a camera."""

from dqslam.simulation.scenario.settings import Count, Positive, Settings


class CameraSettings(Settings):
    """A pinhole camera whose optical axis lies in the robot's x-y plane."""

    focal_length_mm: Positive
    pixel_size_um: Positive
    width_px: Count
    height_px: Count
    heading_deg: float
    """Heading of the optical axis, counter-clockwise from the robot's forward axis."""
    position_in_robot_m: tuple[float, float, float]
