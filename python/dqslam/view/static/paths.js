// Paths in pieces: each lies behind or before other things, is left out where it is out of sight,
// and has a point for two pixels at most, so that a hundred thousand poses are drawn in milliseconds.
"use strict";

class PathPieces {
  /** Points of a path, [x y z] each. */
  constructor(points) {
    this.points = points;
    const size = Math.max(8, Math.ceil(points.length / 400));
    this.pieces = [];
    for (let first = 0; first < points.length - 1; first += size) {
      const last = Math.min(first + size, points.length - 1);
      const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
      for (let k = first; k <= last; k += 1) {
        for (let i = 0; i < 3; i += 1) {
          low[i] = Math.min(low[i], points[k][i]);
          high[i] = Math.max(high[i], points[k][i]);
        }
      }
      const center = geometry.scale(0.5, geometry.add(low, high));
      this.pieces.push({ first, last, center, radius: geometry.length(geometry.subtract(high, center)) });
    }
  }

  /** The pieces in sight of an eye, as {points, depth, isPast}; a piece is cut at the image `frame`. */
  seen({ view, lens, near }, frame) {
    const found = [];
    for (const { first, last, center, radius } of this.pieces) {
      const [x, y, z] = geometry.inCamera(view, center);
      if (z + radius <= near) continue;
      // Beyond a side of the canvas, with its radius.
      const outside = (across, focal, half) => z > 0
        && (Math.abs(across) - 1.5 * radius) * focal > half * (z + radius);
      if (outside(x, lens.fx, lens.cx) || outside(y, lens.fy, lens.cy)) continue;
      const pixels = 2 * radius * lens.fx / Math.max(z - radius, near);
      const every = Math.max(1, Math.floor((last - first) / Math.max(2, pixels / 2)));
      const cut = Math.min(Math.max(frame, first), last);
      for (const [from, to, isPast] of [[first, cut, true], [cut, last, false]]) {
        if (to > from) found.push({ points: this.some(from, to, every), depth: z, isPast });
      }
    }
    return found;
  }

  some(from, to, every) {
    const points = [];
    for (let k = from; k < to; k += every) points.push(this.points[k]);
    points.push(this.points[to]);
    return points;
  }
}
