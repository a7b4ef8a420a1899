"""Maps compared with images and with each other: where a camera is, and what has changed."""
