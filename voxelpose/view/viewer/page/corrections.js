// Corrections by hand: those that were made, each taken back by a button, and one more.

import { postJson } from "./api.js";
import { button, choice, make, notice } from "./elements.js";

const FIELDS = { trim: ["first", "last"], people: ["one", "other", "first"], camera: ["camera", "first", "last"], joint: ["joint"] };
const SIDES = ["one", "first", "last"];

export class Corrections {
  constructor(state, player) {
    const { timeline, canvas } = player;
    const several = state.people.length > 1;
    Object.assign(this, { made: state.corrections, player, timeline, several, person: state.people[0] ?? null, seen: {} });
    const kinds = [["sides", "exchange left and right"], ["arms", "exchange the arms' sides"], ["legs", "exchange the legs' sides"], ["trim", "keep these frames only"],
      several && ["people", "exchange two people"], state.joints.length && state.cameras.length > 2 && ["camera", "fit again without a camera"],
      state.joints.length && ["joint", "set a joint"]].filter(Boolean);
    this.kind = choice("Correction", kinds, "sides", () => this.#kind());
    const people = state.people.map((number) => [number, `person ${number}`]);
    const choose = (label, pairs, k = 0) => choice(label, pairs, pairs[Math.min(k, pairs.length - 1)]?.[0] ?? "", () => this.#kind());
    this.fields = {
      one: choose("Person", people), other: choose("Other person", people, 1),
      camera: choose("Camera", state.cameras.map(({ name }) => [name, name])), joint: choose("Joint", state.joints.map((name) => [name, name.replaceAll("_", " ")])) };
    for (const [name, word, value] of [["first", "from ", state.first], ["last", "to ", state.first + state.count - 1]]) {
      this[name] = make("input", { type: "number", "aria-label": `${name === "first" ? "First" : "Last"} frame`, min: state.first, max: state.first + state.count - 1, value });
      this.fields[name] = make("span", { class: "end" }, word, this[name], button("here", () => (this[name].value = timeline.frame), { title: "The shown frame" }));
    }
    this.note = make("p", { class: "note", role: "status" });
    canvas.addEventListener("click", (event) => this.#click(event));
    this.section = make("section", { class: "corrections" }, make("h2", {}, "Corrections"),
      ...this.made.map(({ words }, k) => make("div", { class: "layer" }, make("span", {}, words),
        button("Undo", () => this.#send(this.made.filter((_, other) => other !== k)), { "aria-label": `Undo: ${words}` }))),
      make("div", { class: "layer" }, this.kind, ...Object.values(this.fields), button("Correct", () => this.#correct())), this.note);
    this.#kind();
  }

  #kind() {
    const kind = this.kind.value;
    for (const [name, field] of Object.entries(this.fields)) {
      field.hidden = !(FIELDS[kind] ?? SIDES).includes(name) || (name === "one" && !this.several);
    }
    this.seen = {};
    this.#say();
  }

  #say() {
    const seen = Object.keys(this.seen).join(", ");
    this.note.textContent = this.kind.value !== "joint" ? "The estimate stays as it is. Exports, report and scores are of the corrected motion, and say so."
      : `Look through a camera and click where the joint is in this frame; then through another one. ${seen && `Clicked in frame ${this.frame}: ${seen}.`}`;
  }

  // Where the joint is in the picture of the camera that is looked through.
  #click({ offsetX, offsetY }) {
    const { viewpoint: { through, moved }, canvas } = this.player;
    if (this.kind.value !== "joint" || !through || moved >= 4) return;
    if (this.frame !== this.timeline.frame) this.seen = {};
    this.frame = this.timeline.frame;
    const [scale, left, top] = through.fitted(canvas.clientWidth, canvas.clientHeight);
    this.seen[through.name] = [(offsetX - left) / scale - 0.5, (offsetY - top) / scale - 0.5];
    this.#say();
  }

  #correct() {
    const kind = this.kind.value;
    const [first, last, one, other] = [this.first, this.last, this.fields.one, this.fields.other].map((field) => Number(field.value));
    const frames = [first, last + 1];
    switch (kind) {
      case "trim": return this.#send([...this.made, { made: { type: "trim", frames } }]);
      case "people": return this.#send([...this.made, { made: { type: "people", first_frame: first, people: [one, other] } }]);
      case "camera": return this.#fitAgain({ frames, camera: this.fields.camera.value });
      case "joint": return this.#fitAgain({
        frames: [this.frame, this.frame + 1], joint: this.fields.joint.value, pixels: Object.entries(this.seen).map(([name, pixel]) => [name, ...pixel]) });
      default: return this.#send([...this.made, { made: { type: "sides", frames, person: this.person && one, limbs: kind === "sides" ? null : kind } }]);
    }
  }

  // By the studio, whose page shows how far it is, or by a command.
  async #fitAgain(asked) {
    try {
      if (asked.joint && !asked.pixels.length) throw new Error("Click where the joint is, first.");
      const { command } = await postJson("api/fit_again", asked);
      notice(command ? `Run this, and load this page again: \`${command}\`` : "These frames are fitted again: the studio shows how far it is. Load this page again after that.");
    } catch (error) {
      notice(error.message);
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
