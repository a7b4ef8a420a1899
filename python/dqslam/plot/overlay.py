"""Outlines of the mapped objects over the images that a camera took."""

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dqslam._checks import Floats
from dqslam._colors import object_colors
from dqslam._files import FileError, whole_file
from dqslam.evaluation import fit_boxes
from dqslam.io import Results
from dqslam.metrics import projected_edges, visible_outlines
from dqslam.plot.frame import draw_boxes
from dqslam.plot.labels import place_labels
from dqslam.plot.style import column_style, new_figure, save_figure, shown_name
from dqslam.plot.tracks import draw_track_cuboids

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

VIDEOS = (".mp4", ".gif")
_DPI = 100  # pixels of the image in an inch of the figure
_RATES = (1.0, 60.0)  # frame rates that can be watched, Hz
_USUAL_RATE = 10.0
_UNSEEN = (0, (3, 2))


class Overlay:
    """One image at a time, with the objects of the map.

    Outlines of objects with a box in the image are thick and have a name on a tab of their color,
    and of cuboids and cylinders the edges, too. The others are dashed, because the objects may be
    occluded. Boxes are thin. Those without an object are white.
    """

    def __init__(self, results: Results) -> None:
        self._results = results
        self.timestamps = results.timestamps
        self._fits = None if results.boxes is None else fit_boxes(results)
        self._solids = results.objects.solids
        self._colors = object_colors(results.objects.class_names)
        camera = results.camera
        self._scale = max(camera.height / 480.0, 0.5)  # lines and names scale with the image
        self.figure = new_figure(camera.width / _DPI, camera.height / _DPI)
        self.figure.set_layout_engine("none")
        self._axes = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))

    def draw(self, pose: int, image: Path) -> "Figure":
        """Draw an image and the objects from a pose.

        Raises
        ------
        FileError
            If the file is no image of the camera's size.
        """
        pixels = read_image(image)
        camera, axes = self._results.camera, self._axes
        height, width = pixels.shape[:2]
        if (width, height) != (camera.width, camera.height):
            raise FileError(
                image,
                f"is {width} x {height}, but the camera's are {camera.width} x {camera.height}",
            )
        axes.clear()
        axes.set_axis_off()
        # Gray values are drawn unscaled: floats from 0 to 1, integers from 0 to 255.
        white = 1.0 if pixels.dtype.kind == "f" else float(np.iinfo(pixels.dtype).max)
        axes.imshow(
            pixels, cmap="gray", vmin=0.0, vmax=white, interpolation="nearest", aspect="auto"
        )
        axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
        detected = np.zeros(0, dtype=np.int64)
        if self._fits is not None:
            detected = draw_boxes(
                axes,
                self._results,
                self._fits,
                pose,
                self._colors,
                lens=True,
                linewidth=0.6 * self._scale,
                unmapped="white",
            )
        here = self._results.poses[pose]
        rows, outlines = visible_outlines(self._results.camera, here, self._solids, lens=True)
        draw_track_cuboids(axes, camera, here, self._results.tracks, pose, self._scale)
        seen = np.isin(rows, detected)
        for row, outline, is_detected in zip(rows, outlines, seen, strict=True):
            self._draw_object(axes, int(row), outline, is_detected=bool(is_detected))
            edges = projected_edges(camera, here, self._solids, int(row), lens=True)
            for edge in edges if is_detected else ():
                line = {"color": self._colors[row], "linewidth": 0.7 * self._scale}
                axes.plot(*edge.T, **line, gid="edge")
        named = rows[seen].tolist()
        objects = self._results.objects
        place_labels(
            axes,
            [outlines[row].T for row in np.flatnonzero(seen)],
            [f"{shown_name(objects.class_names[row])} {objects.object_ids[row]}" for row in named],
            [self._colors[row] for row in named],
            size=6.5 * self._scale,
        )
        return self.figure

    def _draw_object(self, axes: "Axes", row: int, outline: Floats, *, is_detected: bool) -> None:
        from matplotlib.patheffects import withStroke

        scale = self._scale
        dark = [withStroke(linewidth=2.6 * scale, foreground="black", alpha=0.5)]
        axes.plot(
            *outline.T,
            color=self._colors[row],
            linewidth=(1.5 if is_detected else 1.0) * scale,
            linestyle="-" if is_detected else _UNSEEN,
            path_effects=dark if is_detected else None,
            gid="outline",
        )


def read_image(path: Path) -> Any:
    """Read the pixels of an image, shape (height, width) or (height, width, 3 or 4)."""
    from matplotlib.image import imread

    try:
        return imread(path)
    except (OSError, ValueError, SyntaxError) as error:  # Pillow's errors for such a file
        raise FileError(path, f"cannot be read as an image: {error}") from None


def save_stills(
    overlay: Overlay,
    images: Mapping[int, Path],
    folder: Path,
    progress: Callable[[float], None] = lambda share: None,
) -> list[Path]:
    """Write images, by their poses, with their objects into a folder, as PNG of the same size."""
    written = []
    with column_style():
        for done, (pose, image) in enumerate(images.items(), start=1):
            path = folder / f"{image.stem}.png"
            if path.exists() and path.samefile(image):
                raise FileError(path, "is the image itself, which would be overwritten")
            save_figure(overlay.draw(pose, image), path, dpi=_DPI)
            written.append(path)
            progress(done / len(images))
    return written


def save_video(
    overlay: Overlay,
    images: Mapping[int, Path],
    path: Path,
    *,
    rate: float | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> None:
    """Write images, by their poses, with their objects as a film, MP4 or GIF by its suffix.

    ``rate`` is in frames per second, by default that of the poses. The file is complete or absent.

    Raises
    ------
    FileError
        If the suffix is another one, if MP4 lacks ffmpeg, or if an image cannot be read.
    """
    check_video(path)
    if rate is None:
        rate = usual_rate(overlay.timestamps[list(images)])
    with column_style(), whole_file(path) as temporary:
        writer = _writer(path.suffix.lower(), rate)
        with writer.saving(overlay.figure, str(temporary), dpi=_DPI):
            for done, (pose, image) in enumerate(images.items(), start=1):
                overlay.draw(pose, image)
                writer.grab_frame()
                progress(done / len(images))


def check_video(path: Path) -> None:
    """Raise FileError unless a film of this name can be written."""
    if path.suffix.lower() not in VIDEOS:
        raise FileError(path, f"its name ends in none of {', '.join(VIDEOS)}")
    if path.suffix.lower() == ".mp4" and shutil.which("ffmpeg") is None:
        raise FileError(path, "MP4 needs ffmpeg (apt-get install ffmpeg); .gif does not")


def usual_rate(timestamps: Floats) -> float:
    """Return the frame rate [Hz] that shows poses at these times, (n,) s, in real time.

    It is 10 Hz if that rate is too low or too high, for example if times are numbers of frames.
    """
    if len(timestamps) < 2:
        return _USUAL_RATE
    rate = 1.0 / float(np.median(np.diff(timestamps)))
    return rate if _RATES[0] < rate <= _RATES[1] else _USUAL_RATE


def _writer(suffix: str, rate: float) -> Any:
    from matplotlib.animation import FFMpegWriter, PillowWriter

    if suffix == ".gif":
        return PillowWriter(fps=rate)  # type: ignore[arg-type]
    # Browsers need H.264 with even sides.
    even = ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p", "-loglevel", "error"]
    return FFMpegWriter(fps=rate, codec="libx264", extra_args=even)  # type: ignore[arg-type]
