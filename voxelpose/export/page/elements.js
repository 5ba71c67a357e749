// Pieces of the page.

// An element with properties, listeners (onclick ...) and children; texts are never markup.
export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "class") element.className = value;
    else if (name in element) element[name] = value;
    else element.setAttribute(name, value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

// What was changed by the mouse gives the keys back to the player.
const freed = (field) => {
  let clicked = false;
  field.addEventListener("pointerdown", () => (clicked = true));
  field.addEventListener("keydown", () => (clicked = false));
  field.addEventListener("change", () => clicked && field.blur());
  return field;
};

export function checkbox(text, checked, onchange) {
  const box = make("input", {
    type: "checkbox", checked, onchange: () => onchange(box.checked), onclick: (event) => event.detail && box.blur() });
  return make("label", { class: "box" }, box, text);
}

// A choice out of pairs of a value and its words.
export function choice(label, pairs, value, onchange) {
  const field = make("select", { "aria-label": label, onchange: () => onchange(field.value) },
    ...pairs.map(([name, words]) => make("option", { value: name }, words)));
  field.value = value;
  return freed(field);
}

export const css = (colour) => `rgb(${colour.join(" ")})`;

// A line of the legend: colours, and what they mean.
export function swatch(colours, words) {
  const mark = make("i", { class: "swatch" });
  mark.style.background = colours.length === 1 ? css(colours[0]) : `linear-gradient(90deg, ${colours.map(css).join(", ")})`;
  if (colours.length > 1) mark.classList.add("wide");
  return make("div", { class: "line" }, mark, make("span", {}, words));
}
