// Small pieces of the page.

import { make as element } from "./elements.js";

// An element as of elements.js, whose texts may hold code.
export function make(tag, properties = {}, ...children) {
  return element(tag, properties, ...children.flatMap((child) => (typeof child === "string" ? withCode(child) : [child])));
}

// A text whose `words` in backticks are code.
function withCode(text) {
  return text.split("`").map((piece, index) => {
    if (index % 2 === 0) return piece;
    return element("code", {}, piece);
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
