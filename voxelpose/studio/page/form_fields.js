// Fields of a command's settings, in their groups.

import { by, checkbox, make } from "./elements.js";

const GROUPS = { basic: "", person: "The person", camera: "Cameras", output: "Filter and output", expert: "Expert" };

// The usual settings open, between parts before and after them, the others in groups to be opened.
export function grouped(rows, draw, before = [], after = []) {
  return Object.entries(GROUPS).map(([group, title]) => {
    const fields = rows.filter((row) => row.group === group).map(draw);
    if (group === "basic") return make("section", { class: "group" }, make("div", { class: "fields" }, ...before, ...fields, ...after));
    const count = `${fields.length} setting${fields.length === 1 ? "" : "s"}`;
    return fields.length > 0 && make("details", {}, make("summary", {}, title, make("small", {}, count)), make("div", { class: "fields" }, ...fields));
  }).filter(Boolean);
}

// A field whose value is kept in `typed` when it changes; `none` is the word for no choice.
export function field(row, typed, prefix = "set") {
  const id = `${prefix}_${row.name}`;
  const set = (value) => (typed[row.name] = value);
  const help = make("p", { class: "note" }, row.help);
  const value = typed[row.name] === undefined ? row.value : typed[row.name];
  if (row.input === "checkbox") return make("div", { class: "field" }, checkbox(row.title, value ?? row.usual, set, { id, "data-setting": row.name }), help);
  let input;
  if (row.input === "choice") {
    const none = row.none ?? (row.usual === null && "as found");
    input = make("select", { id }, none && make("option", { value: "" }, none), ...row.choices.map((choice) => make("option", { value: choice }, choice)));
    input.value = value ?? row.usual ?? (none ? "" : row.choices[0]);
  } else {
    const numeric = row.input === "number" ? { step: row.whole ? "1" : "any", min: row.least ?? "", max: row.most ?? "" } : {};
    input = make("input", { type: row.input, id, value: value ?? "", placeholder: row.usual ?? "", ...numeric });
  }
  input.dataset.setting = row.name;
  input.addEventListener("change", () => {
    // Nobody is 178 m tall: what no metres can be is read as centimetres, and shown so.
    const metres = Number(input.value) / 100;
    if (row.metres && input.value > row.most && metres >= row.least && metres <= row.most) input.value = metres;
    const text = input.value.trim();
    set(text === "" ? null : row.input === "number" ? Number(text) : text);
  });
  return labelled(row.title, input, help);
}

// A field with its name above it; what else there is stands below.
export const labelled = (name, input, ...more) => make("div", { class: "field" }, make("label", { htmlFor: input.id }, name), input, ...more);

// Whether videos that stand for cameras are played again and again.
export const loopField = (id, set) => make("div", { class: "field" }, checkbox("loop", true, set, { id }),
  make("p", { class: "note" }, "Videos that stand for cameras begin again at their end."));

// Puts an error at its field, in a part of the page or else anywhere in the step; says whether there is one.
export function errorAtField(holder, { field, message }) {
  for (const old of document.querySelectorAll(".fault")) old.remove();
  const named = field && `[data-setting="${CSS.escape(field)}"]`;
  const input = named && (holder?.querySelector(named) ?? [...by("step").querySelectorAll(named)].at(-1));
  if (!input) return false;
  input.closest("details")?.setAttribute("open", "");
  const line = make("p", { class: "fault refused", role: "alert" }, message);
  input.after(line);
  input.addEventListener("input", () => line.remove(), { once: true });
  input.focus();
  return true;
}

// Whether a field of a form holds what it cannot; it says what.
export function isWrong(holder) {
  const wrong = holder.querySelector("input:invalid, input.wrong");
  return Boolean(wrong) && errorAtField(holder, { field: wrong.dataset.setting, message: wrong.validationMessage });
}
