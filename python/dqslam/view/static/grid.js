// The grid on the ground, whose lines are a round number of meters apart.
"use strict";

const LINES = 10; // on each side of what is looked at

/** Draw the grid of a view in space; returns the distance of its lines, meters. */
function drawGrid(space) {
  const { orbit, ground } = space;
  const [east, north] = orbit.level(orbit.target);
  const rough = orbit.distance / 10, power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= rough);
  const half = LINES * step;
  const e = Math.round(east / step) * step, n = Math.round(north / step) * step;
  const style = { strokeStyle: theme.colors.grid, lineWidth: 1 };
  for (let k = -LINES; k <= LINES; k += 1) {
    space.stroke([[e + k * step, n - half, ground], [e + k * step, n + half, ground]].map(orbit.world), style);
    space.stroke([[e - half, n + k * step, ground], [e + half, n + k * step, ground]].map(orbit.world), style);
  }
  return step;
}
