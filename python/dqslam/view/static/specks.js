// Objects so far away that they have no shape on the canvas: squares of a few pixels, painted first and
// all of a color together, so that ten thousand of them are drawn in milliseconds.
"use strict";

const LEAST_SHAPE = 2; // pixels that an object is long, from its center, if it is more than a speck

class Specks {
  constructor() {
    this.count = 0;
    this.squares = new Map();
  }

  /**
   * Where an object is seen, as an outline, if it is only a speck; `reach` is its longest semi-axis
   * in meters. Null if it is larger, or if it is cut by the plane of the eye.
   */
  static outlineOf({ view, lens, near }, center, reach) {
    const [x, y, z] = geometry.inCamera(view, center);
    const half = lens.fx * reach / z;
    if (z <= near + reach || half >= LEAST_SHAPE) return null;
    const long = Math.max(half, 1); // what is smaller would hardly be visible
    const [u, v] = geometry.pixelOf(lens, [x, y, z]);
    return { u, v, depth: z, halfWidth: long, halfHeight: long, long, short: long, angle: 0 };
  }

  add({ u, v, long }, color) {
    if (!this.squares.has(color)) this.squares.set(color, []);
    this.squares.get(color).push(u - long, v - long, 2 * long);
    this.count += 1;
  }

  draw(context) {
    for (const [color, squares] of this.squares) {
      context.fillStyle = color;
      for (let k = 0; k < squares.length; k += 3) {
        context.fillRect(squares[k], squares[k + 1], squares[k + 2], squares[k + 2]);
      }
    }
  }
}
