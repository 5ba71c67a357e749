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
  const there = children.filter((child) => child !== null && child !== undefined && child !== false);
  element.append(...there.flatMap((child) => (typeof child === "string" ? withCode(child) : child)));
  return element;
}

// A text whose `words` in backticks are code.
function withCode(text) {
  return text.split("`").map((piece, index) => {
    if (index % 2 === 0) return piece;
    const code = document.createElement("code");
    code.textContent = piece;
    return code;
  });
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
