"""The largest and smallest numbers that make sense, the same wherever input is checked.

Beyond them, a number is in another unit or column, or a measurement has failed. Within them, no sum
of squares overflows and every file that is written can be read.
"""

LARGEST_NUMBER = 1e40
"""Of any number in a file, before it is known what it is: a covariance in micrometers has less."""
IN_REACH = f"a finite number below {LARGEST_NUMBER:g}"
LARGEST_COORDINATE_M = 1e8
"""No place on Earth is further from an origin, in any frame."""
LARGEST_TIME_S = 1e11
"""Beyond the year 5000: a time of now in milliseconds is larger."""
LARGEST_ANGLE_RAD = 1e6
"""Of a heading that counts its turns."""
LARGEST_PIXEL = 1e6
"""Of the edge of a box, on either side of the image."""
SMALLEST_VARIANCE, LARGEST_VARIANCE = 1e-24, 1e32
"""Of measurements, in square meters, radians or pixels; sums over a path are within them, too."""
LARGEST_STEP_VARIANCE_M2, LARGEST_STEP_VARIANCE_RAD2 = 1e16, 1e6
"""Of one step of a session: far behind a lever of 1e8 m and after a million steps, no sum is beyond
the largest variance."""
LARGEST_ID = 2**62
"""Of an object; its number and the next one are of 64 bits."""
