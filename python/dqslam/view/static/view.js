// The page: switches, the slider of time, the list of objects, and the numbers of the one selected.
"use strict";

(() => {
  const element = (id) => document.getElementById(id);
  const make = ObjectList.element;
  const shapesOf = (objects) => objects.map((object) =>
    object.semiAxes && geometry.shapeOf(object.semiAxes, object.orientation));

  const shown = {
    estimate: true, odometry: true, truth: true, cameras: true, objects: true, surfaces: true, tracks: true,
    names: true, covariance: false, follow: false,
  };
  let selected = {}, waiting = false, byFit = false;

  const shapes = shapesOf(scene.objects), trueShapes = shapesOf(scene.trueObjects);
  const boxesOf = scene.timestamps.map(() => []);
  scene.boxes.pose.forEach((pose, row) => boxesOf[pose].push(row));
  const colorOf = (row) => (byFit ? fitColor(scene.objects[row].chiSquare) : scene.objects[row].color);
  const measure = new Measure();
  const space = new SpaceView(element("space"), scene, { shapes, trueShapes, boxesOf },
    { onPick: pick, onChange: redraw });
  const image = new ImageView(element("image"), scene, { shapes, boxesOf },
    (row) => select(row < 0 ? {} : { mapped: row }));
  const list = new ObjectList(scene.objects, {
    onSelect: (row) => select(selected.mapped === row ? {} : { mapped: row }),
    onFly: (row) => { select({ mapped: row }); space.flyTo(row); },
    onFilter: redraw,
  });
  // The last image at first: paths that lie ahead are faint.
  const player = new Player(scene.timestamps, go, (isPlaying) => {
    element("play").textContent = isPlaying ? "Pause" : "Play";
  });

  /** From blue over white to red: fits better than expected, as expected (3.36), worse. */
  function fitColor(chiSquare) {
    if (chiSquare === null) return "#808080";
    const share = Math.max(-1, Math.min(1, Math.log2(Math.max(chiSquare, 1e-3) / 3.36) / 2));
    const end = share < 0 ? [33, 102, 172] : [178, 24, 43], middle = [225, 215, 195];
    return "#" + middle.map((c, k) => Math.round(c + Math.abs(share) * (end[k] - c)).toString(16).padStart(2, "0")).join("");
  }

  function select(picked) {
    selected = picked;
    showSelected();
    redraw();
  }

  function pick(picked, place) {
    if (!measure.isOn) { select(picked); return; }
    const object = picked.mapped !== undefined ? scene.objects[picked.mapped]
      : picked.true !== undefined ? scene.trueObjects[picked.true] : null;
    const point = object ? object.center : space.onGround(...place);
    measure.add(point && { point, name: object ? `${object.className} ${object.id >= 0 ? object.id : ""}`.trim() : "ground" });
    redraw();
  }

  function redraw() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      const { frame } = player, style = { colorOf, hidden: list.hidden, measure, onLoad: redraw };
      const counts = { ...space.draw(shown, frame, selected, style), image: image.draw(frame, selected.mapped, style) };
      const time = scene.timestamps[frame], since = Number((time - scene.timestamps[0]).toFixed(3));
      const { boxes, heldOut, outlines } = counts.image;
      element("status").value = `image ${frame + 1} of ${scene.timestamps.length}, ${since} s: `
        + `${boxes} boxes${heldOut ? `, ${heldOut} held out` : ""}, ${outlines} objects`;
      element("status").title = `at ${Number(time.toFixed(6))} s`;
      element("hint").textContent = measure.text || `Grid ${Number(space.step.toPrecision(3))} m. Drag to turn, `
        + "shift and drag to move, wheel to zoom, click an object, click twice to fly there.";
      window.onScreen = { // for tests and scripts
        ...counts,
        get places() { return space.places(); },
      };
    });
  }

  function makeSwitches() {
    const titles = {
      estimate: "estimate", odometry: "odometry", truth: "truth", cameras: "cameras", objects: "objects",
      surfaces: "surfaces", tracks: "what moves", names: "names", covariance: "covariance, 3σ",
      follow: "follow the camera",
    };
    const absent = {
      truth: !scene.truth.length, objects: !scene.objects.length, tracks: !scene.tracks.length,
      surfaces: !scene.objects.some((object) => object.surface),
      names: !scene.objects.length && !scene.tracks.length,
      covariance: !scene.poseSpreads.length && !scene.objects.some((object) => object.spread),
    };
    for (const [name, title] of Object.entries(titles)) {
      if (absent[name]) { shown[name] = false; continue; }
      const box = make("input", { type: "checkbox", id: `show-${name}`, checked: shown[name] });
      box.addEventListener("change", () => { shown[name] = box.checked; go(player.frame); });
      const label = make("label", { htmlFor: box.id }, box);
      if (scene.colors[name]) label.append(ObjectList.dot(scene.colors[name]));
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
    list.select(selected.mapped);
    if (!object) return;
    const kind = selected.mapped !== undefined ? "" : "true ";
    const name = [kind + object.className, object.id >= 0 ? object.id : ""].join(" ");
    section.append(make("h2", { textContent: name }), make("dl", {}, ...table(object.numbers)));
    if (selected.mapped !== undefined) {
      const fly = make("button", { type: "button", id: "fly", textContent: "Fly there" });
      fly.addEventListener("click", () => space.flyTo(selected.mapped));
      section.append(fly);
    }
    section.scrollIntoView({ block: "nearest" });
  }

  function go(frame) {
    player.frame = frame;
    element("time").value = String(frame);
    if (shown.follow) space.orbit.follow(scene.estimate[frame].slice(0, 3));
    redraw();
  }

  function listen() {
    const time = element("time");
    time.max = String(scene.timestamps.length - 1); // before the value, which it limits
    time.value = time.max;
    time.addEventListener("input", () => { player.stop(); go(Number(time.value)); });
    element("play").addEventListener("click", () => player.toggle());
    element("speed").addEventListener("change", (event) => { player.speed = Number(event.target.value); });
    element("fit").addEventListener("click", () => space.fit());
    element("by-fit").addEventListener("change", (event) => { byFit = event.target.checked; redraw(); });
    element("dark").addEventListener("click", () => { theme.toggle(); redraw(); });
    element("measure").addEventListener("click", () => {
      measure.toggle();
      element("measure").setAttribute("aria-pressed", String(measure.isOn));
      redraw();
    });
    document.addEventListener("keydown", (event) => {
      if (event.target.matches("input:not([type=range]), button, select") || event.ctrlKey || event.metaKey) return;
      if (event.key === " ") player.toggle();
      else if (event.key === "f") space.fit();
      else return;
      event.preventDefault();
    });
    theme.onChange(redraw);
  }

  document.title = `${scene.title}: dqslam`;
  element("title").textContent = scene.title;
  element("overview").append(...table(scene.overview));
  makeSwitches();
  listen();
  new ResizeObserver(redraw).observe(element("space"));
  new ResizeObserver(redraw).observe(element("image"));
  redraw();
})();
