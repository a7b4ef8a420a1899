// The page: switches, the slider of time, the list of objects, and the numbers of the one selected.
"use strict";

(() => {
  const element = (id) => document.getElementById(id);
  const make = (tag, properties, ...children) => {
    const made = Object.assign(document.createElement(tag), properties);
    made.append(...children);
    return made;
  };
  const dot = (color) => {
    const made = make("i", {});
    made.style.background = color;
    return made;
  };
  const shapesOf = (objects) => objects.map((object) =>
    object.semiAxes && geometry.shapeOf(object.semiAxes, object.orientation));

  const shown = { estimate: true, odometry: true, truth: true, cameras: true, objects: true, names: true, covariance: false, follow: false };
  // The last image at first: paths that lie ahead are faint.
  let frame = scene.timestamps.length - 1, selected = {}, waiting = false, playing = 0;

  const shapes = shapesOf(scene.objects), trueShapes = shapesOf(scene.trueObjects);
  const select = (picked) => { selected = picked; showSelected(); redraw(); };
  const boxesOf = scene.timestamps.map(() => []);
  scene.boxes.pose.forEach((pose, row) => boxesOf[pose].push(row));
  const space = new SpaceView(element("space"), scene, { shapes, trueShapes, boxesOf },
    { onPick: select, onChange: redraw });
  const image = new ImageView(element("image"), scene, { shapes, boxesOf },
    (row) => select(row < 0 ? {} : { mapped: row }));

  function redraw() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      const counts = { ...space.draw(shown, frame, selected), image: image.draw(frame, selected.mapped) };
      const places = space.drawn.filter((one) => one.mapped !== undefined)
        .map(({ object, outline }) => ({ id: object.id, u: outline.u, v: outline.v }));
      const time = Number(scene.timestamps[frame].toFixed(3));
      element("status").value = `image ${frame + 1} of ${scene.timestamps.length}, ${time} s: `
        + `${counts.image.boxes} boxes, ${counts.image.outlines} objects`;
      element("hint").textContent = `Grid ${Number(space.step.toPrecision(3))} m. Drag to turn, shift and drag to move, wheel to zoom, click an object.`;
      window.onScreen = { ...counts, places }; // for tests and scripts
    });
  }

  function makeSwitches() {
    const titles = {
      estimate: "estimate", odometry: "odometry", truth: "truth", cameras: "cameras", objects: "objects",
      names: "names", covariance: "covariance, 3σ", follow: "follow the camera",
    };
    const absent = {
      truth: !scene.truth.length, objects: !scene.objects.length, names: !scene.objects.length,
      covariance: !scene.poseSpreads.length && !scene.objects.some((object) => object.spread),
    };
    for (const [name, title] of Object.entries(titles)) {
      if (absent[name]) { shown[name] = false; continue; }
      const box = make("input", { type: "checkbox", id: `show-${name}`, checked: shown[name] });
      box.addEventListener("change", () => { shown[name] = box.checked; go(frame); });
      const label = make("label", { htmlFor: box.id }, box);
      if (scene.colors[name]) label.append(dot(scene.colors[name]));
      label.append(title);
      element("switches").append(label);
    }
  }

  const table = (numbers) => numbers.flatMap(([name, value]) =>
    [make("dt", { textContent: name }), make("dd", { textContent: value })]);

  function showSelected() {
    const object = selected.mapped !== undefined ? scene.objects[selected.mapped]
      : selected.true !== undefined ? scene.trueObjects[selected.true] : null;
    const section = element("selected");
    section.replaceChildren();
    document.querySelectorAll("#objects button").forEach((button, row) =>
      button.setAttribute("aria-pressed", String(row === selected.mapped)));
    if (!object) return;
    const kind = selected.mapped !== undefined ? "" : "true ";
    const name = [kind + object.className, object.id >= 0 ? object.id : ""].join(" ");
    section.append(make("h2", { textContent: name }), make("dl", {}, ...table(object.numbers)));
  }

  function makeList() {
    scene.objects.forEach((object, row) => {
      const button = make("button", { type: "button" }, dot(object.color), object.className,
        make("span", { className: "id", textContent: String(object.id) }));
      button.setAttribute("aria-pressed", "false");
      button.addEventListener("click", () => select(selected.mapped === row ? {} : { mapped: row }));
      element("objects").append(make("li", {}, button));
    });
  }

  function go(to) {
    frame = to;
    element("time").value = String(to);
    if (shown.follow) space.orbit.follow(scene.estimate[frame].slice(0, 3));
    redraw();
  }

  /** All images in 20 s, or as fast as the screen goes. */
  function play() {
    const last = scene.timestamps.length - 1;
    const start = performance.now(), from = frame >= last ? 0 : frame, rate = Math.max(last / 20, 4);
    const step = (now) => {
      if (!playing) return;
      const next = Math.min(last, from + Math.floor((now - start) / 1000 * rate));
      if (next !== frame) go(next);
      if (next >= last) stop();
      else playing = requestAnimationFrame(step);
    };
    playing = requestAnimationFrame(step);
    element("play").textContent = "Pause";
  }

  function stop() {
    cancelAnimationFrame(playing);
    playing = 0;
    element("play").textContent = "Play";
  }

  document.title = `${scene.title}: dqslam`;
  element("title").textContent = scene.title;
  element("overview").append(...table(scene.overview));
  makeSwitches();
  makeList();
  element("time").max = element("time").value = String(frame);
  element("time").addEventListener("input", (event) => { stop(); go(Number(event.target.value)); });
  element("play").addEventListener("click", () => (playing ? stop() : play()));
  new ResizeObserver(redraw).observe(element("space"));
  new ResizeObserver(redraw).observe(element("image"));
  redraw();
})();
