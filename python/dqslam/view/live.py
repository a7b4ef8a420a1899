"""A scene on a live page, which viser serves."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from html import escape
from io import StringIO
from typing import TYPE_CHECKING, Any

import numpy as np

from dqslam._checks import Floats
from dqslam._colors import ESTIMATE, ODOMETRY, TRUTH
from dqslam.view.live_tracks import LiveTracks
from dqslam.view.picture import draw_image
from dqslam.view.scene import Scene, SceneObject, Spread, rgb
from dqslam.view.surface_mesh import SurfaceMesh

if TYPE_CHECKING:
    from viser import ViserServer

FIELD_OF_VIEW = np.radians(60.0)  # vertical, of the viewer's camera
_NOTHING = "nothing"
_HERE = ("127.0.0.1", "0.0.0.0", "::1", "::")


@contextmanager
def serve(scene: Scene, *, host: str = "127.0.0.1", port: int = 8080) -> Iterator[str]:
    """Serve a scene while inside, and give the page's address; needs ``dqslam[view]``.

    If the port is taken, the next free one is used.
    """
    try:
        import viser
    except ModuleNotFoundError:
        raise RuntimeError(
            "the live page needs viser: pip install 'dqslam[view]' (--export does without)"
        ) from None
    with redirect_stdout(StringIO()):  # only the command line prints
        server = viser.ViserServer(host=host, port=port, label=scene.title, verbose=False)
    try:
        # The share button would send the scene to a server of a third party.
        server.gui.configure_theme(show_logo=False, show_share_button=False)
        _Page(server, scene)
        name = "localhost" if host in _HERE else host
        yield f"http://{name}:{server.get_port()}"
    finally:
        with redirect_stdout(StringIO()):
            server.stop()


class _Page:
    """The content of the page, and its reactions to clicks."""

    def __init__(self, server: ViserServer, scene: Scene) -> None:
        self.server, self.scene = server, scene
        self.frame = 0
        self.selected: int | None = None
        self._look()
        parents = {
            "estimate": self._path("estimate", (scene.estimate,), ESTIMATE, 4.0),
            "odometry": self._path("odometry", (scene.odometry,), ODOMETRY, 3.0),
        }
        if scene.truth:
            parents["truth"] = self._group("truth")
            self._path("truth/path", scene.truth, TRUTH, 2.0)
            for row, one in enumerate(scene.true_objects):
                _solid(server, f"/truth/objects/{row}", one, TRUTH, wireframe=True, opacity=0.5)
        parents["cameras"] = self._cameras()
        parents["objects"] = self._objects()
        parents["names"] = self._names()
        self.tracks = LiveTracks(server, scene.tracks, scene.up) if scene.tracks else None
        if self.tracks is not None:
            parents["tracks"] = self.tracks.group
        spreads = [one.spread for one in scene.objects if one.spread is not None]
        if spreads or scene.pose_spreads:
            parents["covariance"] = self._covariances((*spreads, *scene.pose_spreads))
        self._controls(parents)
        self._show()

    def _look(self) -> None:
        self.server.scene.set_up_direction(self.scene.up)
        self.server.scene.world_axes.visible = False
        eye = self.server.initial_camera
        eye.position, eye.look_at, self.radius = place_eye(self.scene)
        eye.fov, eye.near, eye.far = FIELD_OF_VIEW, 0.002 * self.radius, 100.0 * self.radius

    def _group(self, name: str) -> Any:
        return self.server.scene.add_frame(f"/{name}", show_axes=False)

    def _path(self, name: str, runs: tuple[Floats, ...], color: str, pixels: float) -> Any:
        segments = np.vstack([np.stack([run[:-1, :3], run[1:, :3]], axis=1) for run in runs])
        return self.server.scene.add_line_segments(
            f"/{name}", segments, rgb(color), thickness=pixels, thickness_units="screen"
        )

    def _cameras(self) -> Any:
        group = self._group("cameras")
        camera, size = self.scene.camera, 0.022 * self.radius
        shape: dict[str, Any] = {
            "fov": 2.0 * float(np.arctan(0.5 * camera.height / camera.fy)),
            "aspect": camera.width * camera.fy / (camera.height * camera.fx),
            "thickness_units": "screen",
        }
        for row in self.scene.cameras:
            self.server.scene.add_camera_frustum(
                f"/cameras/{row}",
                **shape,
                scale=size,
                thickness=1.0,
                color=(125, 136, 148),
                **_placed(self.scene.estimate[row]),
            )
        self.camera = self.server.scene.add_camera_frustum(
            "/cameras/current", **shape, scale=2.5 * size, thickness=2.5, color=(20, 20, 20)
        )
        return group

    def _objects(self) -> Any:
        group = self._group("objects")
        self.nodes = {}
        for row, one in enumerate(self.scene.objects):
            node = _solid(self.server, f"/objects/{row}", one, one.color, opacity=0.85)
            if node is not None:
                node.on_click(self._on_click(row))
                if one.surface is None:  # a mesh with colors has no opacity
                    self.nodes[row] = node
        return group

    def _on_click(self, row: int) -> Callable[[Any], None]:
        return lambda _: self._select(row)

    def _names(self) -> Any:
        group = self._group("names")
        for row, one in enumerate(self.scene.objects):
            above = 0.0 if one.semi_axes is None else one.semi_axes.max()
            self.server.scene.add_label(
                f"/names/{row}",
                _name(one),
                position=one.center + above * self.scene.up,
                anchor="bottom-center",
                font_screen_scale=0.8,
            )
        return group

    def _covariances(self, spreads: tuple[Spread, ...]) -> Any:
        group = self._group("covariance")
        group.visible = False
        for row, one in enumerate(spreads):
            _solid(self.server, f"/covariance/{row}", one, "#111111", opacity=0.5)
        return group

    def _controls(self, parents: dict[str, Any]) -> None:
        gui = self.server.gui
        last = len(self.scene.timestamps) - 1
        self.slider = gui.add_slider("image", min=0, max=max(last, 1), step=1, initial_value=0)
        self.slider.on_update(lambda _: self._go(min(int(self.slider.value), last)))
        self.picture = gui.add_html("")
        names = [_NOTHING, *(_name(one) for one in self.scene.objects)]
        self.choice: Any = gui.add_dropdown("object", names, initial_value=_NOTHING)
        self.choice.on_update(lambda _: self._choose(names.index(self.choice.value) - 1))
        self.numbers = gui.add_html("")
        with gui.add_folder("show"):
            for name, node in parents.items():
                box = gui.add_checkbox(name, initial_value=node.visible)
                box.on_update(_switch(node, box))
        with gui.add_folder("all"):
            gui.add_html(_table(self.scene.overview))

    def _go(self, frame: int) -> None:
        self.frame = frame
        self._show()

    def _select(self, row: int) -> None:
        self.choice.value = _name(self.scene.objects[row])  # which calls _choose

    def _choose(self, row: int) -> None:
        for each, node in self.nodes.items():
            node.opacity = 1.0 if each == row else 0.85 if row < 0 else 0.45
        self.selected = None if row < 0 else row
        self._show()

    def _show(self) -> None:
        placed = _placed(self.scene.estimate[self.frame])
        with self.server.atomic():
            self.camera.position, self.camera.wxyz = placed["position"], placed["wxyz"]
            if self.tracks is not None:
                self.tracks.show(self.frame)
            time = f"{self.scene.timestamps[self.frame]:.3f} s"
            picture = draw_image(self.scene, self.frame, self.selected)
            self.picture.content = f'<div style="padding:0 1em">{picture}{time}</div>'
            chosen = None if self.selected is None else self.scene.objects[self.selected]
            self.numbers.content = "" if chosen is None else _table(chosen.numbers)


def place_eye(scene: Scene) -> tuple[Floats, Floats, float]:
    """Return the places (3,) to look from and at for a view of all, and its radius, meters."""
    points = scene.estimate[:, :3]
    low, high = points.min(axis=0), points.max(axis=0)
    if scene.objects:
        # A few things that are far away do not count, or everything else would be a dot.
        centers = np.array([one.center for one in scene.objects])
        low = np.minimum(low, np.quantile(centers, 0.1, axis=0))
        high = np.maximum(high, np.quantile(centers, 0.9, axis=0))
    radius = max(0.5 * float(np.linalg.norm(high - low)), 1e-3)
    middle = 0.5 * (low + high)
    along = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][0]
    beside = np.cross(along, scene.up)
    length = float(np.linalg.norm(beside))
    beside = beside / length if length > 1e-6 else np.roll(scene.up, 1)
    return middle + radius * (1.3 * beside + 0.9 * scene.up), middle, radius


def _solid(
    server: ViserServer,
    name: str,
    one: SceneObject | Spread,
    color: str,
    *,
    opacity: float,
    wireframe: bool = False,
) -> Any:
    """Add an object; return None if it has no surface."""
    if isinstance(one, SceneObject) and one.surface is not None:
        return _surface(server, name, one, one.surface)
    if isinstance(one, SceneObject) and one.body is not None:
        surface = one.body.mesh
        return server.scene.add_mesh_simple(
            name,
            surface.vertices - one.center,
            surface.triangles,
            color=rgb(color),
            wireframe=wireframe,
            opacity=opacity,
            flat_shading=True,
            position=one.center,
        )
    if one.semi_axes is None or one.orientation_xyzw is None:
        return None
    return server.scene.add_icosphere(
        name,
        radius=1.0,
        color=rgb(color),
        scale=(float(one.semi_axes[0]), float(one.semi_axes[1]), float(one.semi_axes[2])),
        wireframe=wireframe,
        opacity=opacity,
        subdivisions=2 if wireframe else 4,
        **_placed(np.concatenate([one.center, one.orientation_xyzw])),
    )


def _surface(server: ViserServer, name: str, one: SceneObject, surface: SurfaceMesh) -> Any:
    """Add a surface, whose vertices are in the frame of the object's ellipsoid."""
    import trimesh

    assert one.orientation_xyzw is not None  # of each object with a surface
    mesh = trimesh.Trimesh(
        surface.vertices, surface.triangles, vertex_colors=surface.colors, process=False
    )
    pose = _placed(np.concatenate([one.center, one.orientation_xyzw]))
    return server.scene.add_mesh_trimesh(name, mesh, **pose)


def _placed(pose: Floats) -> dict[str, Any]:
    """Return viser's keyword arguments for a pose [tx ty tz qx qy qz qw]."""
    return {"position": pose[:3], "wxyz": pose[[6, 3, 4, 5]]}


def _switch(node: Any, box: Any) -> Callable[[Any], None]:
    def update(_: Any) -> None:
        node.visible = box.value

    return update


def _name(one: SceneObject) -> str:
    return f"{one.class_name} {one.id}"


def _table(numbers: tuple[tuple[str, str], ...]) -> str:
    rows = "".join(
        f'<tr><td style="color:#777">{escape(name)}</td>'
        f'<td style="text-align:right">{escape(value)}</td></tr>'
        for name, value in numbers
    )
    return f'<table style="width:100%;padding:0 1em;font-size:0.85em">{rows}</table>'
