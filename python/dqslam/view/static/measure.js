// Measuring: the distance of two places, which are centers of objects or points of the ground.
"use strict";

class Measure {
  constructor() { this.isOn = false; this.places = []; }

  toggle() { this.isOn = !this.isOn; this.places = []; }

  /** Add a place {point, name}; a third one begins anew. */
  add(place) {
    if (!place) return;
    this.places = this.places.length === 2 ? [place] : [...this.places, place];
  }

  get text() {
    if (!this.isOn) return "";
    const [first, second] = this.places;
    if (!first) return "Measure: click an object or the ground.";
    if (!second) return `From ${first.name}: click an object or the ground.`;
    const meters = geometry.length(geometry.subtract(second.point, first.point));
    return `${first.name} to ${second.name}: ${meters.toFixed(3)} m`;
  }

  draw(space) {
    if (!this.isOn) return;
    const points = this.places.map((place) => place.point);
    for (const point of points) {
      const place = geometry.inCamera(space.eye.view, point);
      if (place[2] > space.eye.near) space.dot(...geometry.pixelOf(space.eye.lens, place));
    }
    if (points.length === 2) space.stroke(points, { strokeStyle: theme.colors["chosen-line"], lineWidth: 2 });
  }
}
