// Small pieces of the page.

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

export const button = (text, onclick, more = {}) => make("button", { onclick, ...more }, text);

export function checkbox(text, checked, onchange, more = {}) {
  const box = make("input", { type: "checkbox", checked, ...more });
  box.addEventListener("change", () => onchange(box.checked));
  return make("label", {}, box, text);
}

// Where something is not possible, and why.
export const refusal = (text) => make("p", { class: "refused" }, text);

export const number = (value, digits) => (Number.isFinite(value) ? value.toFixed(digits) : "–");
