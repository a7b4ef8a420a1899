// The list of objects with its search, and the classes, each of which can be hidden.
"use strict";

class ObjectList {
  /** `onSelect` has the row of an object, `onFly` too; `onFilter` is called if classes change. */
  constructor(objects, { onSelect, onFly, onFilter }) {
    Object.assign(this, { objects, onSelect, onFly });
    this.hidden = new Set();
    this.most = 300; // buttons: more would make the page slow, and nobody reads them
    this.list = document.getElementById("objects");
    this.search = document.getElementById("search");
    this.search.addEventListener("input", () => this.show());
    this.makeClasses(onFilter);
    this.show();
  }

  static element(tag, properties, ...children) {
    const made = Object.assign(document.createElement(tag), properties);
    made.append(...children);
    return made;
  }

  static dot(color) {
    const made = document.createElement("i");
    made.style.background = color;
    return made;
  }

  makeClasses(onFilter) {
    const counts = new Map(), colors = new Map();
    for (const { className, color } of this.objects) {
      counts.set(className, (counts.get(className) || 0) + 1);
      colors.set(className, colors.has(className) && colors.get(className) !== color ? "#808080" : color);
    }
    for (const name of [...counts.keys()].sort()) {
      const button = ObjectList.element("button", { type: "button", title: "hide or show this class" },
        ObjectList.dot(colors.get(name)), `${name} ${counts.get(name)}`);
      button.setAttribute("aria-pressed", "true");
      button.addEventListener("click", () => {
        if (!this.hidden.delete(name)) this.hidden.add(name);
        button.setAttribute("aria-pressed", String(!this.hidden.has(name)));
        this.show();
        onFilter();
      });
      document.getElementById("classes").append(button);
    }
  }

  /** Rows of the objects that are searched for: each word is in the class, or is the id. */
  matches() {
    const words = this.search.value.toLowerCase().split(/\s+/).filter(Boolean);
    return [...this.objects.keys()].filter((row) => {
      const { className, id } = this.objects[row];
      return !this.hidden.has(className)
        && words.every((word) => className.toLowerCase().includes(word) || String(id) === word);
    });
  }

  show() {
    const rows = this.matches();
    this.buttons = new Map();
    const items = rows.slice(0, this.most).map((row) => {
      const { className, color, id } = this.objects[row];
      const button = ObjectList.element("button", { type: "button" }, ObjectList.dot(color), className,
        ObjectList.element("span", { className: "id", textContent: String(id) }));
      button.setAttribute("aria-pressed", String(row === this.selected));
      button.addEventListener("click", () => this.onSelect(row));
      button.addEventListener("dblclick", () => this.onFly(row));
      this.buttons.set(row, button);
      return ObjectList.element("li", {}, button);
    });
    this.list.replaceChildren(...items);
    const more = rows.length - items.length;
    document.getElementById("more").textContent = more > 0 ? `and ${more} more: search for them` : "";
  }

  /** Mark an object, undefined for none. */
  select(row) {
    this.buttons.get(this.selected)?.setAttribute("aria-pressed", "false");
    this.selected = row;
    this.buttons.get(row)?.setAttribute("aria-pressed", "true");
  }
}
