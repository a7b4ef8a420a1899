// The eye that looks at the map: it orbits a point, steered by mouse, touch or keys.
"use strict";

class Orbit {
  /** Look at points of the world, `up` a unit vector; `onChange` is called when the eye moves. */
  constructor(canvas, up, points, onChange) {
    Object.assign(this, { canvas, up, onChange });
    const axis = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].find((one) => Math.abs(geometry.dot(one, up)) < 0.6);
    this.east = geometry.unit(geometry.subtract(axis, geometry.scale(geometry.dot(axis, up), up)));
    this.north = geometry.cross(up, this.east);
    this.pointers = new Map();
    this.frame(points);
    this.listen();
  }

  /** Coordinates along east, north and up. */
  level = (point) => [this.east, this.north, this.up].map((axis) => geometry.dot(axis, point));

  world = ([east, north, up]) => geometry.add(geometry.scale(up, this.up),
    geometry.add(geometry.scale(east, this.east), geometry.scale(north, this.north)));

  /** Stand where all points are seen, looking across the longest way they go. */
  frame(points) {
    const level = points.map(this.level);
    const low = [0, 1, 2].map((k) => level.reduce((least, p) => Math.min(least, p[k]), Infinity));
    const high = [0, 1, 2].map((k) => level.reduce((most, p) => Math.max(most, p[k]), -Infinity));
    const middle = [0, 1, 2].map((k) => (low[k] + high[k]) / 2);
    this.radius = Math.max(Math.hypot(...[0, 1, 2].map((k) => high[k] - low[k])) / 2, 1e-3);
    let [xx, xy, yy] = [0, 0, 0];
    for (const [x, y] of level) {
      xx += (x - middle[0]) ** 2; yy += (y - middle[1]) ** 2; xy += (x - middle[0]) * (y - middle[1]);
    }
    this.target = this.world(middle);
    this.yaw = 0.5 * Math.atan2(2 * xy, xx - yy) - Math.PI / 2;
    this.pitch = 0.62;
    this.distance = 2.1 * this.radius / Math.min(1, this.canvas.clientWidth / this.canvas.clientHeight);
  }

  /** The eye as a camera: its place and axes, and its lens in CSS pixels. */
  look() {
    const level = [
      Math.cos(this.pitch) * Math.cos(this.yaw), Math.cos(this.pitch) * Math.sin(this.yaw), Math.sin(this.pitch)];
    const back = this.world(level);
    const forward = geometry.scale(-1, back);
    const right = geometry.unit(geometry.cross(forward, this.up));
    const view = {
      center: geometry.add(this.target, geometry.scale(this.distance, back)),
      axes: [right, geometry.cross(forward, right), forward],
    };
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const focal = 1.2 * height;
    return { view, lens: { fx: focal, fy: focal, cx: width / 2, cy: height / 2 }, near: 0.005 * this.distance };
  }

  /** Look at another point from the same side. */
  follow(point) {
    this.target = point;
    this.onChange();
  }

  turn(right, down) {
    this.yaw -= 0.007 * right;
    this.pitch = Math.min(1.5, Math.max(-1.5, this.pitch + 0.006 * down));
    this.onChange();
  }

  move(right, down) {
    const { view, lens } = this.look();
    const meters = this.distance / lens.fx;
    const shift = geometry.add(geometry.scale(-right * meters, view.axes[0]),
      geometry.scale(-down * meters, view.axes[1]));
    this.target = geometry.add(this.target, shift);
    this.onChange();
  }

  /** Come nearer or go away; what is at a place of the canvas, CSS pixels, stays there. */
  zoom(factor, x = this.canvas.clientWidth / 2, y = this.canvas.clientHeight / 2) {
    const { view, lens } = this.look();
    const before = this.distance;
    this.distance = Math.min(50 * this.radius, Math.max(0.002 * this.radius, before * factor));
    const meters = (before - this.distance) / lens.fx;
    this.target = geometry.add(this.target, geometry.add(
      geometry.scale((x - lens.cx) * meters, view.axes[0]), geometry.scale((y - lens.cy) * meters, view.axes[1])));
    this.onChange();
  }

  /** Move to a point within 0.4 s, and look at it from a distance, meters. */
  fly(point, distance) {
    const from = { target: this.target, distance: this.distance }, start = performance.now();
    const step = (now) => {
      const share = Math.min(1, (now - start) / 400), eased = share * share * (3 - 2 * share);
      this.target = geometry.add(from.target, geometry.scale(eased, geometry.subtract(point, from.target)));
      this.distance = from.distance * (distance / from.distance) ** eased;
      this.onChange();
      if (share < 1) requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  listen() {
    const { canvas, pointers } = this;
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const factor = Math.exp(0.0012 * event.deltaY * (event.deltaMode === 1 ? 30 : 1));
      this.zoom(factor, event.offsetX, event.offsetY);
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, (event) => pointers.delete(event.pointerId));
    }
    canvas.addEventListener("pointermove", (event) => this.drag(event));
    const steps = {
      ArrowLeft: () => this.turn(-20, 0), ArrowRight: () => this.turn(20, 0),
      ArrowUp: () => this.turn(0, 20), ArrowDown: () => this.turn(0, -20),
      "+": () => this.zoom(0.85), "=": () => this.zoom(0.85), "-": () => this.zoom(1 / 0.85),
    };
    canvas.addEventListener("keydown", (event) => {
      if (!steps[event.key] || event.ctrlKey || event.metaKey) return;
      event.preventDefault();
      steps[event.key]();
    });
  }

  /** One finger or the mouse turns; two fingers, shift or another button move; a pinch zooms. */
  drag(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    const [right, down] = [now[0] - before[0], now[1] - before[1]];
    const other = [...this.pointers].find(([id]) => id !== event.pointerId);
    this.pointers.set(event.pointerId, now);
    if (other) {
      const apart = (point) => Math.hypot(point[0] - other[1][0], point[1] - other[1][1]);
      this.zoom(apart(before) / Math.max(apart(now), 1));
      this.move(right / 2, down / 2);
    } else if (event.shiftKey || event.buttons & 6) {
      this.move(right, down);
    } else {
      this.turn(right, down);
    }
  }
}
