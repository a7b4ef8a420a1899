// Colors of what is painted, from the style sheet: light or dark, as the system or the button says.
"use strict";

const theme = (() => {
  const names = ["grid", "text", "halo", "chosen-line", "camera"];
  const system = matchMedia("(prefers-color-scheme: dark)");
  const colors = {};

  function read() {
    const style = getComputedStyle(document.documentElement);
    for (const name of names) colors[name] = style.getPropertyValue(`--${name}`).trim();
  }

  /** Change between light and dark. */
  function toggle() {
    const root = document.documentElement;
    const isDark = root.dataset.theme ? root.dataset.theme === "dark" : system.matches;
    root.dataset.theme = isDark ? "light" : "dark";
    read();
  }

  read();
  return { colors, toggle, onChange: (call) => system.addEventListener("change", () => { read(); call(); }) };
})();
