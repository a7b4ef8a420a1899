"""The names of the worlds, in the order of the table."""

WORLDS: dict[str, tuple[str, ...]] = {
    "The paper's loop": ("loop", "loop_cubes", "loop_cuboids"),
    "Shapes and sizes": ("needles", "poles", "plates", "sizes"),
    "Paths": (
        "corridor_forward",
        "corridor_sideways",
        "figure_of_eight",
        "loop_200m",
        "loop_200m_quarter",
        "orbit_rolls",
        "flight",
    ),
    "Odometry": (
        "odometry_x4",
        "odometry_overconfident",
        "scale_3",
        "gyro_bias",
        "slips",
        "jumps",
        "gap_10s",
        "weak_links",
    ),
    "Boxes": (
        "occlusion",
        "clipped",
        "missing_50",
        "noise_10px",
        "whole_pixels",
        "biased_3px",
        "heavy_tails",
    ),
    "Boxes of something else": (
        "false_10",
        "false_30",
        "false_own_20",
        "swapped_20",
        "bursts_20",
        "bursts_40",
    ),
    "Calibration": ("mount_yaw_2", "mount_pitch_2", "focal_2", "late_50ms"),
}
"""The scenarios of data/scenarios/worlds by the part of the world that is unlike the paper's."""


def all_worlds() -> tuple[str, ...]:
    """Return the names of all worlds."""
    return tuple(name for names in WORLDS.values() for name in names)
