// The image plane: the boxes of one image, and the outlines of the objects as they should be seen.
"use strict";

class ImageView {
  /** `shapes` are those of the objects, null where one is no ellipsoid; `boxesOf` rows of each image. */
  constructor(canvas, scene, { shapes, boxesOf }, onPick) {
    Object.assign(this, { canvas, scene, shapes, boxesOf });
    canvas.style.aspectRatio = `${scene.camera.width} / ${scene.camera.height}`;
    canvas.addEventListener("click", (event) => onPick(this.pick(event.offsetX, event.offsetY)));
    this.outlines = [];
    this.photographs = new Map();
  }

  /** The photograph of an image, null if there is none or it is still loading. */
  photograph(frame, onLoad) {
    const name = this.scene.images?.[frame];
    if (!name) return null;
    if (!this.photographs.has(frame)) {
      if (this.photographs.size > 60) this.photographs.clear();
      const photograph = new Image();
      photograph.onload = onLoad;
      photograph.src = `images/${name}`;
      this.photographs.set(frame, photograph);
    }
    const found = this.photographs.get(frame);
    return found.complete && found.naturalWidth ? found : null;
  }

  /** Draw an image; returns how many boxes it has, of them held out, and how many objects. */
  draw(frame, selected, { colorOf, hidden, onLoad }) {
    this.colorOf = colorOf;
    const { camera, boxes } = this.scene;
    const ratio = window.devicePixelRatio || 1;
    this.scale = this.canvas.clientWidth / camera.width;
    this.canvas.width = Math.round(this.canvas.clientWidth * ratio);
    this.canvas.height = Math.round(this.canvas.clientHeight * ratio);
    const context = this.canvas.getContext("2d");
    // Whole numbers are centers of pixels, hence the border is half a pixel before them.
    context.setTransform(ratio * this.scale, 0, 0, ratio * this.scale,
      ratio * this.scale / 2, ratio * this.scale / 2);
    const photograph = this.photograph(frame, onLoad);
    if (photograph) context.drawImage(photograph, -0.5, -0.5, camera.width, camera.height);
    const rows = this.boxesOf[frame].filter((row) => !hidden.has(boxes.className[row]));
    const seen = new Set(rows.map((row) => boxes.object[row]));
    this.outlines = this.outlinesIn(frame).filter(({ row }) => !hidden.has(this.scene.objects[row].className));
    for (const { row, outline } of this.outlines) {
      this.drawOutline(context, outline, colorOf(row), seen.has(row), row === selected);
    }
    for (const row of rows) this.drawBox(context, row, selected);
    this.drawNames(context, rows, selected);
    const heldOut = rows.filter((row) => boxes.state[row] === "held out").length;
    return { boxes: rows.length, heldOut, outlines: this.outlines.length, photograph: Boolean(photograph) };
  }

  /** Outlines of all objects that are in front of the camera and meet the image. */
  outlinesIn(frame) {
    const { camera, estimate, objects } = this.scene;
    const view = geometry.viewOf(estimate[frame]);
    const found = [];
    objects.forEach((object, row) => {
      const outline = this.shapes[row] &&
        geometry.outlineOfObject(view, camera, object, this.shapes[row]);
      if (!outline) return;
      const inside = outline.u + outline.halfWidth > 0 && outline.u - outline.halfWidth < camera.width
        && outline.v + outline.halfHeight > 0 && outline.v - outline.halfHeight < camera.height;
      if (inside) found.push({ row, outline });
    });
    return found.sort((a, b) => b.outline.depth - a.outline.depth);
  }

  drawOutline(context, outline, color, seen, isSelected) {
    const path = geometry.pathOf(outline);
    context.setLineDash([]);
    context.globalAlpha = seen ? 1 : 0.35;
    context.fillStyle = color + (isSelected ? "66" : "2b");
    if (seen || isSelected) context.fill(path);
    context.lineWidth = (isSelected ? 2.5 : 1.4) / this.scale;
    context.strokeStyle = color;
    context.stroke(path);
    context.globalAlpha = 1;
  }

  drawBox(context, row, selected) {
    const { boxes } = this.scene;
    const [left, top, right, bottom] = boxes.box[row];
    const object = boxes.object[row], state = boxes.state[row];
    const pixel = 1 / this.scale;
    const dashes = { fits: [], misfit: [6, 4], "held out": [1.5, 3], "left out": [] };
    context.setLineDash(dashes[state].map((dash) => dash * pixel));
    context.lineWidth = (state === "left out" ? 0.8 : object === selected && object >= 0 ? 3 : 1.8) * pixel;
    context.strokeStyle = object >= 0 ? this.colorOf(object) : "#999";
    context.strokeRect(left, top, right - left, bottom - top);
    context.setLineDash([]);
  }

  /** Write the name of each box above it: the selected one first, then those of the map; none over another. */
  drawNames(context, rows, selected) {
    const { boxes, objects } = this.scene, pixel = 1 / this.scale, taken = [];
    context.font = `${10 * pixel}px system-ui, sans-serif`;
    context.lineWidth = 3 * pixel;
    context.strokeStyle = "#ffffffd0";
    const rank = (row) => (boxes.object[row] < 0 ? 2 : boxes.object[row] === selected ? 0 : 1);
    for (const row of [...rows].sort((a, b) => rank(a) - rank(b))) {
      const object = objects[boxes.object[row]], [left, top] = boxes.box[row];
      const name = object ? `${boxes.className[row]} ${object.id}` : boxes.className[row];
      const height = Math.max(top - 3 * pixel, 10 * pixel);
      const right = left + context.measureText(name).width;
      if (!takePlace(taken, [left, height - 9 * pixel, right, height + 2 * pixel])) continue;
      context.fillStyle = object ? "#222" : "#888";
      context.strokeText(name, left, height);
      context.fillText(name, left, height);
    }
  }

  /** The nearest object at a place of the canvas, CSS pixels; -1 for none. */
  pick(x, y) {
    const u = x / this.scale - 0.5, v = y / this.scale - 0.5;
    const hit = this.outlines.filter(({ outline }) => geometry.contains(outline, u, v, 2));
    return hit.length ? hit[hit.length - 1].row : -1;
  }
}
