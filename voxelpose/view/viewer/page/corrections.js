// Corrections by hand: those that were made, each taken back by a button, and one more.

import { postJson } from "./api.js";
import { button, choice, make, notice } from "./elements.js";

const KINDS = [["sides", "exchange left and right"], ["trim", "keep these frames only"], ["people", "exchange two people"]];

export class Corrections {
  constructor(state, timeline) {
    Object.assign(this, { made: state.corrections, timeline });
    const people = state.people.map((number) => [number, `person ${number}`]);
    const last = state.first + state.count - 1;
    this.kind = choice("Correction", people.length > 1 ? KINDS : KINDS.slice(0, 2), "sides", () => this.#kind());
    [this.one, this.other] = ["Person", "Other person"].map((label, k) => choice(label, people, people[Math.min(k, people.length - 1)]?.[0] ?? "", () => {}));
    [this.first, this.last] = [["First frame", state.first], ["Last frame", last]].map(
      ([label, value]) => make("input", { type: "number", "aria-label": label, min: state.first, max: last, value }));
    this.ends = [this.first, this.last].map((field, k) => make("span", { class: "end" }, k ? "to " : "from ", field,
      button("here", () => (field.value = timeline.frame), { title: "The shown frame" })));
    this.several = people.length > 1;
    this.person = state.people[0] ?? null;
    this.section = make("section", { class: "corrections" }, make("h2", {}, "Corrections"),
      ...this.made.map(({ words }, k) => make("div", { class: "layer" }, make("span", {}, words),
        button("Undo", () => this.#send(this.made.filter((_, other) => other !== k)), { "aria-label": `Undo: ${words}` }))),
      make("div", { class: "layer" }, this.kind, this.one, this.other),
      make("div", { class: "layer" }, ...this.ends, button("Correct", () => this.#send([...this.made, { made: this.#asked() }]))),
      make("p", { class: "note" }, "The estimate stays as it is. Exports, report and scores are of the corrected motion, and say so."));
    this.#kind();
  }

  #kind() {
    const kind = this.kind.value;
    this.one.hidden = !this.several || kind === "trim";
    this.other.hidden = !this.several || kind !== "people";
    this.ends[1].hidden = kind === "people";
  }

  #asked() {
    const [first, last, one] = [this.first, this.last, this.one].map((field) => Number(field.value));
    switch (this.kind.value) {
      case "trim": return { type: "trim", frames: [first, last + 1] };
      case "people": return { type: "people", first_frame: first, people: [one, Number(this.other.value)] };
      default: return { type: "sides", frames: [first, last + 1], person: this.person && one };
    }
  }

  // The page is loaded again: bodies, hulls and frames are others.
  async #send(list) {
    try {
      await postJson("api/corrections", { corrections: list.map(({ made }) => made) });
      location.reload();
    } catch (error) {
      notice(error.message);
    }
  }
}
