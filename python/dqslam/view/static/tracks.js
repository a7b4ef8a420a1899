// What moves: the path of each track and, in the image on show, its cuboid with an arrow ahead.
"use strict";

class MovingThing {
  /** Take a track of the scene. */
  constructor(track) {
    this.track = track;
    this.path = new PathPieces(track.centers);
  }

  /** The row of the last image that shows it up to one: -1 before its first, the last after it. */
  rowUpTo(frame) {
    let [low, high] = [-1, this.track.pose.length - 1];
    while (low < high) {
      const middle = Math.ceil((low + high) / 2);
      if (this.track.pose[middle] <= frame) low = middle; else high = middle - 1;
    }
    return low;
  }

  /** Its corners in one of its images: the digits of a corner's number are front, left and top. */
  corners(row) {
    const { centers, orientations, sides } = this.track;
    const view = { center: centers[row], axes: geometry.axesOf(orientations[row]) };
    const half = (corner, k) => ((corner >> (2 - k)) & 1 ? 0.5 : -0.5) * sides[k];
    return [...Array(8).keys()].map((corner) => geometry.toWorld(view, [0, 1, 2].map((k) => half(corner, k))));
  }

  /** Add it to the items that a view of space paints; returns its name and place, null if unseen. */
  add(space, items, frame) {
    const { track } = this, row = this.rowUpTo(frame), { view, lens, near } = space.eye;
    for (const { points, depth, isPast } of this.path.seen(space.eye, row)) {
      const style = { strokeStyle: track.color, lineWidth: 2, globalAlpha: isPast ? 0.95 : 0.35 };
      items.push({ depth, draw: () => space.stroke(points, style) });
    }
    if (row < 0 || frame > track.pose[track.pose.length - 1]) return null; // nobody knows where it is
    const corners = this.corners(row);
    const seen = corners.map((corner) => geometry.inCamera(view, corner));
    if (seen.some((place) => place[2] <= near)) return null;
    const pixels = seen.map((place) => geometry.pixelOf(lens, place));
    const us = pixels.map(([u]) => u), vs = pixels.map(([, v]) => v);
    const box = [Math.min(...us), Math.min(...vs), Math.max(...us), Math.max(...vs)];
    if (box[0] > 2 * lens.cx || box[2] < 0 || box[1] > 2 * lens.cy || box[3] < 0) return null;
    const depth = space.depthOf(track.centers[row]);
    items.push({ depth, draw: () => this.draw(space, row, corners, pixels) });
    const outline = { u: (box[0] + box[2]) / 2, v: (box[1] + box[3]) / 2, halfHeight: (box[3] - box[1]) / 2, depth };
    return { name: track.names[row], outline };
  }

  draw(space, row, corners, pixels) {
    const { color, centers, sides, orientations } = this.track;
    space.fill({ polygon: geometry.hullOf(pixels) }, color + "60", null);
    space.fill({ polygon: [4, 5, 7, 6].map((corner) => pixels[corner]) }, color + "a0", null); // the front
    const line = { strokeStyle: color, lineWidth: 2 };
    for (let corner = 0; corner < 8; corner += 1) {
      for (const digit of [1, 2, 4]) {
        if (!(corner & digit)) space.stroke([corners[corner], corners[corner | digit]], line);
      }
    }
    // From the middle of its foot to half its length ahead of its front.
    const view = { center: centers[row], axes: geometry.axesOf(orientations[row]) };
    const [length, width, height] = sides;
    const foot = (ahead, left) => geometry.toWorld(view, [ahead * length, left * width, -height / 2]);
    space.stroke([foot(0, 0), foot(1, 0)], line);
    space.stroke([foot(0.85, 0.15), foot(1, 0), foot(0.85, -0.15)], line);
  }
}
