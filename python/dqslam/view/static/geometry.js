// Vectors, poses and outlines. Conventions are those of the files: poses world_from_camera
// [tx ty tz qx qy qz qw], the camera's x right, y down, z forward; meters and undistorted pixels.
"use strict";

const geometry = (() => {
  const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
  const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const scale = (s, a) => [s * a[0], s * a[1], s * a[2]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [
    a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const length = (a) => Math.hypot(...a);
  const unit = (a) => scale(1 / length(a), a);

  /** The three axes, as vectors of the target, of a unit quaternion target_from_source. */
  function axesOf([x, y, z, w]) {
    return [
      [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)],
      [2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)],
      [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)],
    ];
  }

  /** Where a camera is, and its axes in the world. */
  const viewOf = (pose) => ({ center: pose.slice(0, 3), axes: axesOf(pose.slice(3)) });

  /** A point of the world in the camera. */
  function inCamera(view, point) {
    const ray = subtract(point, view.center);
    return [dot(view.axes[0], ray), dot(view.axes[1], ray), dot(view.axes[2], ray)];
  }

  const toWorld = (view, [x, y, z]) =>
    add(view.center, add(scale(x, view.axes[0]), add(scale(y, view.axes[1]), scale(z, view.axes[2]))));

  /** Pixels of a point in front of the camera. */
  const pixelOf = (lens, [x, y, z]) => [lens.fx * x / z + lens.cx, lens.fy * y / z + lens.cy];

  /** S = R diag(a^2) R^T, 3 by 3. */
  function shapeOf(semiAxes, quaternion) {
    const axes = axesOf(quaternion);
    return [0, 1, 2].map((i) => [0, 1, 2].map((j) =>
      [0, 1, 2].reduce((sum, k) => sum + semiAxes[k] ** 2 * axes[k][i] * axes[k][j], 0)));
  }

  /**
   * The ellipse that an ellipsoid is seen as, null unless all of it is in front of the camera.
   *
   * The dual conic of center p and shape M in the camera is C* = p p^T - M, for a camera of focal
   * length 1. Divided by its last entry it is [m m^T - E, m; m^T, 1]: center m, shape E.
   */
  function outlineOf(view, lens, center, shape) {
    const p = inCamera(view, center);
    const across = view.axes.map((axis) => shape.map((row) => dot(row, axis)));
    const M = (i, j) => dot(view.axes[i], across[j]);
    const last = p[2] * p[2] - M(2, 2);
    if (p[2] <= 0 || last <= 0) return null;
    const x = (p[0] * p[2] - M(0, 2)) / last, y = (p[1] * p[2] - M(1, 2)) / last;
    const uu = lens.fx ** 2 * (x * x - (p[0] * p[0] - M(0, 0)) / last);
    const vv = lens.fy ** 2 * (y * y - (p[1] * p[1] - M(1, 1)) / last);
    const uv = lens.fx * lens.fy * (x * y - (p[0] * p[1] - M(0, 1)) / last);
    const mean = (uu + vv) / 2, spread = Math.hypot((uu - vv) / 2, uv);
    return {
      u: lens.fx * x + lens.cx, v: lens.fy * y + lens.cy, depth: p[2],
      halfWidth: Math.sqrt(uu), halfHeight: Math.sqrt(vv),
      long: Math.sqrt(mean + spread), short: Math.sqrt(Math.max(mean - spread, 0)),
      angle: 0.5 * Math.atan2(2 * uv, uu - vv),
    };
  }

  /**
   * The outline of an object: the ellipse of its shape or, of a cuboid or a cylinder, that of the
   * ellipsoid that stands for it, with the hull of its points as `polygon`.
   */
  function outlineOfObject(view, lens, object, shape) {
    const outline = outlineOf(view, lens, object.center, shape);
    if (!outline || !object.body) return outline;
    const points = object.body.hull.map((point) => inCamera(view, point));
    if (points.some((point) => point[2] <= 0)) return null;
    return { ...outline, polygon: hullOf(points.map((point) => pixelOf(lens, point))) };
  }

  /** The corners of the hull of points of the image, in order around it (monotone chain). */
  function hullOf(points) {
    const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
    const half = (order) => {
      const chain = [];
      for (const point of order) {
        while (chain.length > 1 && turnOf(chain[chain.length - 2], chain[chain.length - 1], point) <= 0) chain.pop();
        chain.push(point);
      }
      return chain.slice(0, -1);
    };
    return [...half(sorted), ...half(sorted.reverse())];
  }

  /** Twice the area of a triangle in the image. */
  const turnOf = (a, b, c) => (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);

  /** A path around an outline. */
  function pathOf(outline) {
    const path = new Path2D();
    if (outline.polygon) {
      outline.polygon.forEach(([u, v]) => path.lineTo(u, v));
      path.closePath();
    } else {
      path.ellipse(outline.u, outline.v, outline.long, outline.short, outline.angle, 0, 2 * Math.PI);
    }
    return path;
  }

  /** Whether a pixel is within an outline, which is made larger by a margin, pixels. */
  function contains(outline, u, v, margin = 0) {
    if (outline.polygon) {
      return outline.polygon.every((a, k, all) => {
        const b = all[(k + 1) % all.length];
        return turnOf(a, b, [u, v]) >= -margin * Math.hypot(b[0] - a[0], b[1] - a[1]);
      });
    }
    const du = u - outline.u, dv = v - outline.v;
    const c = Math.cos(outline.angle), s = Math.sin(outline.angle);
    const along = (c * du + s * dv) / (outline.long + margin);
    const across = (c * dv - s * du) / (outline.short + margin);
    return along * along + across * across <= 1;
  }

  return {
    add, subtract, scale, dot, cross, length, unit, axesOf, viewOf, inCamera, toWorld, pixelOf,
    shapeOf, outlineOf, outlineOfObject, hullOf, pathOf, contains,
  };
})();
