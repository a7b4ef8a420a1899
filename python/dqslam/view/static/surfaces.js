// Surfaces of objects from depth images: triangles with flat shading, painted from far to near.
"use strict";

class Surface {
  /** Take the mesh of an object, which is in the frame of the object. */
  constructor({ center, orientation, surface }) {
    const view = { center, axes: geometry.axesOf(orientation) };
    this.vertices = surface.vertices.map((vertex) => geometry.toWorld(view, vertex));
    const colors = surface.vertices.map((_, k) =>
      [0, 2, 4].map((at) => parseInt(surface.colors.slice(6 * k + at, 6 * k + at + 2), 16)));
    this.triangles = surface.triangles.map((corners) => {
      const [a, b, c] = corners.map((corner) => this.vertices[corner]);
      const across = geometry.cross(geometry.subtract(b, a), geometry.subtract(c, a));
      const color = [0, 1, 2].map((k) => corners.reduce((sum, corner) => sum + colors[corner][k] / 3, 0));
      return { corners, at: a, normal: geometry.scale(1 / (geometry.length(across) || 1), across), color };
    });
  }

  /**
   * Paint what the eye sees, lit from above its left shoulder; returns the number of triangles.
   *
   * The inside of an open mesh is seen, too, and darker. Triangles that reach behind the eye are
   * left out.
   */
  draw(context, { view, lens, near }) {
    const places = this.vertices.map((vertex) => geometry.inCamera(view, vertex));
    const pixels = places.map((place) => (place[2] > near ? geometry.pixelOf(lens, place) : null));
    const light = geometry.unit(geometry.subtract(geometry.scale(-0.6, geometry.add(view.axes[0], view.axes[1])), view.axes[2]));
    const seen = this.triangles.filter(({ corners }) => corners.every((corner) => pixels[corner]));
    const depth = ({ corners: [a, b, c] }) => places[a][2] + places[b][2] + places[c][2];
    context.setLineDash([]);
    context.lineWidth = 0.8;
    for (const { triangle: { corners, at, normal, color } } of seen.map((triangle) => ({ triangle, depth: depth(triangle) }))
      .sort((a, b) => b.depth - a.depth)) {
      const isOutside = geometry.dot(normal, geometry.subtract(view.center, at)) > 0;
      const bright = isOutside ? 0.6 + 0.45 * Math.max(0, geometry.dot(normal, light)) : 0.4;
      // The line closes the seam that smooth edges leave between neighbors.
      context.fillStyle = context.strokeStyle = `rgb(${color.map((c) => Math.round(Math.min(255, bright * c))).join()})`;
      context.beginPath();
      for (const corner of corners) context.lineTo(...pixels[corner]);
      context.closePath();
      context.fill();
      context.stroke();
    }
    return seen.length;
  }
}
