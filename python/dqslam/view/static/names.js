// Names above the objects and above what moves; of two that would cover each other, only the nearer one's.
"use strict";

const MOST_NAMES = 150;
const MOST_NAMED = 400; // of the largest objects on the canvas; more have no room for names

/** Add a rectangle [left, top, right, bottom] to those that are taken, unless it would cover one of them. */
function takePlace(taken, place) {
  const covers = (t) => place[0] < t[2] && place[2] > t[0] && place[1] < t[3] && place[3] > t[1];
  if (taken.some(covers)) return false;
  taken.push(place);
  return true;
}

/** Write names of what was drawn, the selected one first; returns how many. */
function drawNames(context, drawn, selected) {
  const taken = [];
  context.font = "12px system-ui, sans-serif";
  context.textAlign = "center";
  const isChosen = (one) => one.mapped !== undefined && one.mapped === selected.mapped;
  const largest = [...drawn].sort((a, b) => isChosen(b) - isChosen(a) || b.outline.long - a.outline.long);
  const order = largest.filter((one) => one.mapped !== undefined || one.name).slice(0, MOST_NAMED)
    .sort((a, b) => isChosen(b) - isChosen(a) || a.outline.depth - b.outline.depth);
  for (const { object, name, outline } of order) {
    if (taken.length === MOST_NAMES) break;
    const text = name || `${object.className} ${object.id}`;
    const half = context.measureText(text).width / 2 + 2;
    const x = outline.u, y = outline.v - outline.halfHeight - 5;
    const place = [x - half, y - 12, x + half, y + 3];
    if (!takePlace(taken, place)) continue;
    Object.assign(context, { lineWidth: 3.5, strokeStyle: theme.colors.halo, fillStyle: theme.colors.text });
    context.setLineDash([]);
    context.strokeText(text, x, y);
    context.fillText(text, x, y);
  }
  return taken.length;
}
