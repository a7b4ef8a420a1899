// The map in space, painted from far to near on a plain canvas: an ellipsoid is seen as an ellipse,
// whose equation is that of its dual conic, and a cuboid or a cylinder as the hull of its points, so
// that neither meshes nor a graphics card are needed.
"use strict";

const CIRCLE = Array.from({ length: 49 }, (_, k) => [Math.cos(k * Math.PI / 24), Math.sin(k * Math.PI / 24)]);

const MOST_DETAILED = 200; // objects with light and rings
const LEAST_SURFACE = 6; // pixels that an object is long if its surface is drawn instead of its body

class SpaceView {
  /**
   * `shapes` and `trueShapes` are those of the objects, null where one is no ellipsoid; `boxesOf`
   * has the rows of the boxes of each image.
   */
  constructor(canvas, scene, { shapes, trueShapes, boxesOf }, { onPick, onChange }) {
    Object.assign(this, { canvas, scene, shapes, trueShapes, boxesOf });
    this.drawn = [];
    this.surfaces = scene.objects.map((object) => object.surface && new Surface(object));
    this.reaches = scene.objects.map(({ semiAxes }) => semiAxes && Math.max(...semiAxes));
    const path = scene.estimate.map((pose) => pose.slice(0, 3));
    this.everything = [...path, ...this.near(path)];
    this.orbit = new Orbit(canvas, scene.up, this.everything, onChange);
    this.ground = this.findGround(path);
    this.moving = scene.tracks.map((track) => new MovingThing(track));
    const places = (poses) => poses.map((pose) => pose.slice(0, 3));
    this.paths = { odometry: [places(scene.odometry)], truth: scene.truth.map(places), estimate: [path] };
    for (const [name, runs] of Object.entries(this.paths)) this.paths[name] = runs.map((run) => new PathPieces(run));
    let down = [0, 0];
    canvas.addEventListener("pointerdown", (event) => { down = [event.offsetX, event.offsetY]; });
    canvas.addEventListener("click", (event) => {
      const moved = Math.hypot(event.offsetX - down[0], event.offsetY - down[1]);
      if (moved < 4) onPick(this.pick(event.offsetX, event.offsetY), [event.offsetX, event.offsetY]);
    });
    canvas.addEventListener("dblclick", (event) => this.flyTo(this.pick(event.offsetX, event.offsetY).mapped));
  }

  /** Centers of the objects and of what moves, without those so far off that the rest would be a dot. */
  near(path) {
    const middle = [0, 1, 2].map((k) => path.reduce((sum, point) => sum + point[k], 0) / path.length);
    const away = (point) => geometry.length(geometry.subtract(point, middle));
    const { objects, tracks } = this.scene, centers = objects.map((object) => object.center);
    const usual = centers.map(away).sort((a, b) => a - b)[Math.floor(centers.length / 2)];
    const most = 3 * path.reduce((largest, point) => Math.max(largest, away(point)), usual || 0);
    return [...centers, ...tracks.flatMap((track) => track.centers)].filter((center) => away(center) < most);
  }

  /** The height that the tenth part of the objects reaches down to, or the path, meters. */
  findGround(path) {
    const { up, objects } = this.scene;
    const bottoms = objects.flatMap((object, row) => {
      if (!this.shapes[row]) return [];
      const below = this.shapes[row].reduce((sum, line, k) => sum + up[k] * geometry.dot(line, up), 0);
      return [geometry.dot(object.center, up) - Math.sqrt(below)];
    }).sort((a, b) => a - b);
    if (bottoms.length) return bottoms[Math.floor(bottoms.length / 10)];
    return path.reduce((least, point) => Math.min(least, geometry.dot(point, up)), Infinity);
  }

  /** Stand again where all is seen. */
  fit() {
    this.orbit.frame(this.everything);
    this.orbit.onChange();
  }

  /** Fly to an object by its row. */
  flyTo(row) {
    if (row === undefined) return;
    const { center, semiAxes } = this.scene.objects[row];
    this.orbit.fly(center, 12 * Math.max(...(semiAxes || [0.01 * this.orbit.radius])));
  }

  /** Where a place of the canvas is on the ground, null if that is beyond the horizon. */
  onGround(x, y) {
    const { view, lens } = this.orbit.look();
    const ray = geometry.subtract(geometry.toWorld(view, [(x - lens.cx) / lens.fx, (y - lens.cy) / lens.fy, 1]), view.center);
    const { up } = this.scene;
    const far = (this.ground - geometry.dot(view.center, up)) / geometry.dot(ray, up);
    return far > 0 ? geometry.add(view.center, geometry.scale(far, ray)) : null;
  }

  /** Draw what the switches ask for; returns how much of each is on the canvas. */
  draw(shown, frame, selected, { colorOf, hidden, measure }) {
    Object.assign(this, { colorOf, hidden });
    const ratio = window.devicePixelRatio || 1;
    this.canvas.width = Math.round(this.canvas.clientWidth * ratio);
    this.canvas.height = Math.round(this.canvas.clientHeight * ratio);
    // Painted by the processor: ten thousand small shapes are slower on most graphics cards.
    this.context = this.canvas.getContext("2d", { willReadFrequently: true });
    this.context.scale(ratio, ratio);
    this.context.lineJoin = "round";
    this.eye = this.orbit.look();
    this.counts = { ellipsoids: 0, triangles: 0, labels: 0, covariances: 0, cameras: 0, trueObjects: 0, odometry: 0, truth: 0, estimate: 0 };
    this.drawn = [];
    this.specks = new Specks();
    this.step = drawGrid(this);
    const items = [];
    for (const name of ["odometry", "truth", "estimate"]) {
      if (!shown[name]) continue;
      for (const run of this.paths[name]) this.addPath(items, name, run, name === "truth" ? Infinity : frame);
    }
    if (shown.cameras) this.addCameras(items, frame);
    if (shown.covariance) this.scene.poseSpreads.forEach((spread) => this.addSpread(items, spread));
    if (shown.truth) this.scene.trueObjects.forEach((_, row) => this.addTrue(items, row, selected));
    this.scene.objects.forEach((_, row) => this.addObject(items, row, shown, selected));
    const moving = this.moving.filter(({ track }) => shown.tracks && !hidden.has(track.className))
      .map((thing) => thing.add(this, items, frame)).filter((seen) => seen);
    this.counts.tracks = moving.length;
    // Light and rings only where there is room to see them, and for the largest on the canvas.
    const sizes = this.drawn.map(({ outline }) => outline.long).sort((a, b) => b - a);
    this.detailed = Math.max(8, sizes[MOST_DETAILED] || 0);
    this.specks.draw(this.context);
    this.counts.specks = this.specks.count;
    this.counts.ellipsoids += this.specks.count;
    items.sort((a, b) => b.depth - a.depth).forEach((item) => item.draw());
    if (shown.names) this.counts.labels = drawNames(this.context, [...this.drawn, ...moving], selected);
    measure.draw(this);
    return this.counts;
  }

  /** Draw lines through points of the world; parts behind the eye are cut off. */
  stroke(points, style) {
    const { view, lens, near } = this.eye;
    const path = new Path2D();
    let before = null;
    for (const point of points) {
      const now = geometry.inCamera(view, point);
      if (before && (now[2] > near || before[2] > near)) {
        const cut = (a, b) => {
          const part = (near - a[2]) / (b[2] - a[2]);
          return geometry.add(a, geometry.scale(part, geometry.subtract(b, a)));
        };
        if (before[2] <= near) path.moveTo(...geometry.pixelOf(lens, cut(before, now)));
        path.lineTo(...geometry.pixelOf(lens, now[2] > near ? now : cut(before, now)));
      } else if (now[2] > near) {
        path.moveTo(...geometry.pixelOf(lens, now));
      }
      before = now;
    }
    Object.assign(this.context, { globalAlpha: 1, lineWidth: 1 }, style);
    this.context.setLineDash([]);
    this.context.stroke(path);
    this.context.globalAlpha = 1;
  }

  depthOf(point) {
    return geometry.inCamera(this.eye.view, point)[2];
  }

  /** A path; what is to come is faint. */
  addPath(items, name, pieces, frame) {
    for (const { points, depth, isPast } of pieces.seen(this.eye, frame)) {
      const style = {
        strokeStyle: this.scene.colors[name], lineWidth: name === "truth" ? 4 : 2,
        globalAlpha: name === "truth" ? 0.5 : isPast ? 0.95 : 0.35,
      };
      this.counts[name] += points.length - 1;
      items.push({ depth, draw: () => this.stroke(points, style) });
    }
  }

  addCameras(items, frame) {
    const { estimate } = this.scene;
    const size = 0.022 * this.orbit.radius;
    for (const k of this.scene.cameras) {
      if (k !== frame) this.addCamera(items, estimate[k], size, { strokeStyle: theme.colors.camera, globalAlpha: 0.55 });
    }
    this.addCamera(items, estimate[frame], 2.5 * size, { strokeStyle: theme.colors["chosen-line"], lineWidth: 1.8 }, frame);
  }

  /** A pyramid from the camera to its image, which is `size` meters away; boxes on the current one. */
  addCamera(items, pose, size, style, frame = -1) {
    const { camera, boxes } = this.scene;
    const view = geometry.viewOf(pose);
    const at = (u, v) => geometry.toWorld(view,
      [size * (u - camera.cx) / camera.fx, size * (v - camera.cy) / camera.fy, size]);
    const rectangle = (l, t, r, b) => [at(l, t), at(r, t), at(r, b), at(l, b), at(l, t)];
    const image = rectangle(-0.5, -0.5, camera.width - 0.5, camera.height - 0.5);
    this.counts.cameras += 1;
    const draw = () => {
      this.stroke(image, style);
      for (const corner of image.slice(0, 4)) this.stroke([view.center, corner], style);
      for (const row of frame < 0 ? [] : this.boxesOf[frame]) {
        if (boxes.object[row] < 0) continue;
        const style = { strokeStyle: this.colorOf(boxes.object[row]), lineWidth: 1.5 };
        this.stroke(rectangle(...boxes.box[row]), style);
      }
    };
    items.push({ depth: this.depthOf(view.center), draw });
  }

  addTrue(items, row, selected) {
    const object = this.scene.trueObjects[row];
    const isSelected = selected.true === row;
    const style = { strokeStyle: this.scene.colors.truth, lineWidth: isSelected ? 3 : 1.6, setLineDash: [5, 4] };
    this.addOutline(items, object, this.trueShapes[row], { true: row }, (outline) => {
      this.fill(outline, this.scene.colors.truth + "22", style);
      this.counts.trueObjects += 1;
    }, style);
  }

  addObject(items, row, shown, selected) {
    const object = this.scene.objects[row];
    if (this.hidden.has(object.className)) return;
    const isSelected = selected.mapped === row, color = this.colorOf(row);
    const speck = isSelected || !this.reaches[row] ? null : Specks.outlineOf(this.eye, object.center, this.reaches[row]);
    if (shown.objects && speck) {
      if (!this.isSeen(speck)) return;
      this.drawn.push({ mapped: row, object, outline: speck });
      this.specks.add(speck, color);
    }
    const style = { strokeStyle: isSelected ? theme.colors["chosen-line"] : color, lineWidth: isSelected ? 2.6 : 1.2 };
    if (shown.objects && !speck) {
      this.addOutline(items, object, this.shapes[row], { mapped: row }, (outline) => {
        const isDetailed = outline.long >= this.detailed;
        if (shown.surfaces && this.surfaces[row] && outline.long >= LEAST_SURFACE) {
          this.counts.triangles += this.surfaces[row].draw(this.context, this.eye);
          if (isSelected) this.fill(outline, "#0000", style);
          return;
        }
        this.fill(outline, isDetailed ? this.shade(outline, color) : color + "d0", isDetailed || isSelected ? style : null);
        if (isDetailed) this.drawRings(object);
        this.counts.ellipsoids += 1;
      }, style);
    }
    if (shown.covariance && object.spread) this.addSpread(items, object.spread);
  }

  /** Add the ellipsoid of a covariance. */
  addSpread(items, { center, semiAxes, orientation }) {
    const shape = geometry.shapeOf(semiAxes, orientation);
    const outline = geometry.outlineOf(this.eye.view, this.eye.lens, center, shape);
    if (!outline) return;
    // Before the object itself, which mostly is around it.
    items.push({ depth: outline.depth - 1e-6, draw: () => {
      this.fill(outline, "#ffffff30", { strokeStyle: theme.colors.text, lineWidth: 1.2, setLineDash: [3, 2] });
      this.counts.covariances += 1;
    } });
  }

  /** Whether a part of an outline is on the canvas. */
  isSeen({ u, v, halfWidth, halfHeight }) {
    const { cx, cy } = this.eye.lens;
    return Math.abs(u - cx) <= cx + halfWidth && Math.abs(v - cy) <= cy + halfHeight;
  }

  /** Add an object as an outline or, where it is no ellipsoid, as a cross. */
  addOutline(items, object, shape, name, paint, style) {
    const { view, lens, near } = this.eye;
    const outline = shape && geometry.outlineOfObject(view, lens, object, shape);
    if (outline && !this.isSeen(outline)) return;
    if (outline) {
      this.drawn.push({ ...name, object, outline });
      items.push({ depth: outline.depth, draw: () => paint(outline) });
    } else if (!shape) {
      const place = geometry.inCamera(view, object.center);
      if (place[2] <= near) return;
      const [u, v] = geometry.pixelOf(lens, place);
      const cross = { u, v, depth: place[2], halfWidth: 6, halfHeight: 6, long: 6, short: 6, angle: 0 };
      this.drawn.push({ ...name, object, outline: cross });
      const line = new Path2D(`M${u - 6} ${v}h12M${u} ${v - 6}v12`);
      items.push({ depth: place[2], draw: () => {
        Object.assign(this.context, { strokeStyle: style.strokeStyle, lineWidth: 2 });
        this.context.setLineDash([]);
        this.context.stroke(line);
      } });
    }
  }

  /** A small disc at a place of the canvas. */
  dot(u, v) {
    this.context.fillStyle = theme.colors["chosen-line"];
    this.context.beginPath();
    this.context.arc(u, v, 4, 0, 2 * Math.PI);
    this.context.fill();
  }

  /** Fill an outline, and draw its line in a style, null for none. */
  fill(outline, fill, style) {
    const path = geometry.pathOf(outline);
    this.context.fillStyle = fill;
    this.context.fill(path);
    if (!style) return;
    const { setLineDash = [], ...line } = style;
    Object.assign(this.context, line);
    this.context.setLineDash(setLineDash);
    this.context.stroke(path);
  }

  /** A gradient as if light came from the upper left. */
  shade({ u, v, halfWidth, halfHeight, long }, color) {
    const light = [u - 0.35 * halfWidth, v - 0.45 * halfHeight];
    const gradient = this.context.createRadialGradient(...light, 0, u, v, 1.15 * long);
    const [r, g, b] = [1, 3, 5].map((k) => parseInt(color.slice(k, k + 2), 16));
    const mix = (other, part, alpha) =>
      `rgba(${[r, g, b].map((c) => Math.round(c + part * (other - c))).join()},${alpha})`;
    gradient.addColorStop(0, mix(255, 0.65, 0.85));
    gradient.addColorStop(0.5, mix(255, 0.15, 0.8));
    gradient.addColorStop(1, mix(0, 0.25, 0.85));
    return gradient;
  }

  /**
   * The three rings of the principal axes, as far as they face the eye: they show how it is turned.
   * Of a cuboid or a cylinder all edges.
   */
  drawRings({ center, semiAxes, orientation, body }) {
    if (body) {
      for (const line of body.lines) this.stroke(line, { strokeStyle: "#fff", globalAlpha: 0.55 });
      return;
    }
    const axes = geometry.axesOf(orientation);
    const toEye = geometry.subtract(this.eye.view.center, center);
    for (const [i, j] of [[0, 1], [1, 2], [2, 0]]) {
      let part = [];
      const flush = () => {
        if (part.length > 1) this.stroke(part, { strokeStyle: "#fff", globalAlpha: 0.55 });
        part = [];
      };
      for (const [c, s] of CIRCLE) {
        const along = geometry.add(geometry.scale(semiAxes[i] * c, axes[i]), geometry.scale(semiAxes[j] * s, axes[j]));
        const normal = geometry.add(geometry.scale(c / semiAxes[i], axes[i]), geometry.scale(s / semiAxes[j], axes[j]));
        if (geometry.dot(normal, geometry.subtract(toEye, along)) > 0) part.push(geometry.add(center, along));
        else flush();
      }
      flush();
    }
  }

  /** Where the mapped objects are on the canvas, as {id, u, v}. */
  places() {
    return this.drawn.filter((one) => one.mapped !== undefined)
      .map(({ object, outline }) => ({ id: object.id, u: outline.u, v: outline.v }));
  }

  /** The nearest object at a place of the canvas, CSS pixels, a mapped one if any; empty for none. */
  pick(x, y) {
    const isTrue = (one) => one.mapped === undefined;
    const [hit] = this.drawn.filter(({ outline }) => geometry.contains(outline, x, y, 3))
      .sort((a, b) => isTrue(a) - isTrue(b) || a.outline.depth - b.outline.depth);
    if (!hit) return {};
    return isTrue(hit) ? { true: hit.true } : { mapped: hit.mapped };
  }
}
