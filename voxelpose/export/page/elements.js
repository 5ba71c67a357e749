// Pieces of pages.

export const by = (id) => document.getElementById(id);

// Text in which marks that are not seen, and may reorder it, are written as \u202e, for example.
export const visible = (text) => text.replace(/(?![\t\n])[\p{Cc}\p{Cf}\p{Zl}\p{Zp}]/gu, (mark) => `\\u${mark.codePointAt(0).toString(16).padStart(4, "0")}`);

// An element with properties, listeners (onclick ...) and children. Texts are never markup, and
// visible; what stands in backticks is code.
export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "class") element.className = value;
    else if (name in element) element[name] = name === "title" ? visible(String(value)) : value;
    else element.setAttribute(name, value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined && child !== false).flatMap(
    (child) => (typeof child !== "string" ? [child] : tag === "code" ? [visible(child)] : withCode(child))));
  return element;
}

const withCode = (text) => visible(text).split("`").map((piece, index) => (index % 2 ? make("code", {}, piece) : piece));

// Tells the user on top of the page; "": nothing any more.
export function notice(text) {
  by("banner").hidden = !text;
  by("banner").replaceChildren(...withCode(text));
}

// What was changed by the mouse gives the keys back to the player.
const freed = (field) => {
  let clicked = false;
  field.addEventListener("pointerdown", () => (clicked = true));
  field.addEventListener("keydown", () => (clicked = false));
  field.addEventListener("change", () => clicked && field.blur());
  return field;
};

export const button = (text, onclick, more = {}) => make("button", { onclick, ...more }, text);

export function checkbox(text, checked, onchange, more = {}) {
  const box = make("input", {
    type: "checkbox", checked, onchange: () => onchange(box.checked), onclick: (event) => event.detail && box.blur(), ...more });
  return make("label", { class: "box" }, box, text);
}

// A choice out of pairs of a value and its words.
export function choice(label, pairs, value, onchange) {
  const field = make("select", { "aria-label": label, onchange: () => onchange(field.value) },
    ...pairs.map(([name, words]) => make("option", { value: name }, words)));
  field.value = value;
  return freed(field);
}

// A table with names of its columns, and rows of cells: texts, or cells that are made already.
export const table = (names, rows, more = {}) => make("table", more,
  make("thead", {}, make("tr", {}, ...names.map((name) => make("th", {}, name)))), make("tbody", {}, ...rows));

export const tableRow = (cells, more = {}) =>
  make("tr", more, ...cells.map((cell) => (typeof cell === "string" ? make("td", {}, cell) : cell)));

// Where something is not possible, and why.
export const refusal = (text) => make("p", { class: "refused" }, text);

export const rounded = (value, digits) => (Number.isFinite(value) ? value.toFixed(digits) : "–");

// A name that is not taken: the stem with the first number that is free.
export function freeName(stem, taken, number = 1) {
  while (taken.includes(`${stem}${number}`)) number++;
  return `${stem}${number}`;
}

export const css = (colour) => `rgb(${colour.join(" ")})`;

// A line of the legend: colours, and what they mean.
export function swatch(colours, words) {
  const mark = make("i", { class: "swatch" });
  mark.style.background = colours.length === 1 ? css(colours[0]) : `linear-gradient(90deg, ${colours.map(css).join(", ")})`;
  if (colours.length > 1) mark.classList.add("wide");
  return make("div", { class: "line" }, mark, make("span", {}, words));
}
