// Stages of silhouettes: what they are called, their pictures, and the pixel under the mouse explained.

import { loadImage, postJson } from "./api.js";
import { by, make } from "./elements.js";

const later = (milliseconds) => new Promise((done) => setTimeout(done, milliseconds));

export const STAGES = {
  picture: ["Picture", "The frame as it was filmed."],
  background: ["Background", "The empty view as it was learned. Hatched: nobody saw it, its colours are a guess."],
  odds: ["Odds", "What colours and background say: blue for the person, brown against, black neither. They decide, with edges and neighbours."],
  first: ["First cut", "The person before edges are sharpened, and specks, holes and what is outside the region are removed."],
  silhouette: ["Silhouette", "As the estimation begins with it."],
  body: ["Body", "The silhouette as it was used, made again with the body that it found. Green: added to that of the picture alone; pink: taken out; yellow: outline of the fitted body."],
};

// Names of the stages that there are: masks have none, the method paper few.
export function stageNames({ masks, paper, fitted }) {
  const few = paper ? ["picture", "background", "first", "silhouette"] : Object.keys(STAGES).slice(0, -1);
  return [...(masks ? ["picture"] : few), ...(fitted ? ["body"] : [])];
}

export const stageButtons = (names, shown, choose) =>
  make("div", { class: "choices", role: "group", "aria-label": "Shown" }, ...names.map((name) => make("button", {
    onclick: () => choose(name), "data-stage": name, "aria-pressed": name === shown }, STAGES[name][0])));

// Runs one task after a pause, and only the last one that is asked for; its `current()` tells
// whether another was asked for meanwhile.
export function latest(pause, task, failed) {
  let number = 0;
  return async () => {
    const mine = ++number;
    const current = () => mine === number;
    await later(pause);
    if (!current()) return;
    try {
      await task(current);
    } catch (error) {
      if (current()) failed(error);
    }
  };
}

export class Stages {
  // The views by name; `request()` is what silhouettes depend on, `note(text)` shows what is told.
  constructor(views, request, note) {
    Object.assign(this, { views, request, note });
    this.load = latest(250, (current) => this.pictures(current), (error) => note(error.message));
    this.loadPixel = latest(30, (current) => this.pixel(current), (error) => this.pixelText(error.message));
  }

  // Fetches a stage's pictures if it is another, or what it depends on is; null: none.
  show(stage) {
    const key = stage && stage + JSON.stringify(this.request());
    if (key === this.key) return;
    this.key = key;
    this.stage = stage;
    this.load();
  }

  // An answer, once the backgrounds are learned; null where it is not wanted any more.
  async ready(path, request, current) {
    let answer = await postJson(path, request);
    while (!answer.ready) {
      this.note("Learning the backgrounds, a few seconds …");
      await later(400);
      if (!current()) return null;
      answer = await postJson(path, request);
    }
    return current() ? answer : null;
  }

  async pictures(current) {
    const { stage } = this;
    const notes = [];
    for (const view of stage ? this.views.values() : []) {
      const answer = await this.ready("api/stage", { ...this.request(), camera: view.name, stage }, current);
      if (!answer) return;
      const image = await loadImage(`data:image/png;base64,${answer.png}`);
      if (!current()) return;
      view.staged = { stage, image };
      view.draw();
      if (answer.note) notes.push(`${view.name}: ${answer.note}.`);
    }
    this.note(notes.join("\n"));
  }

  // Tells what a pixel of a camera is taken for, in the place of the hint; null: no longer.
  explain(asked) {
    this.asked = asked;
    if (asked) this.loadPixel();
    else this.pixelText("");
  }

  async pixel(current) {
    const { asked } = this;
    if (!asked) return;
    const answer = await this.ready("api/stage", { ...this.request(), ...asked }, current);
    if (!answer || this.asked !== asked) return;
    const { here, background, known, measures, person, why } = answer.explained;
    const colour = (text, values) => {
      const swatch = make("i");
      swatch.style.background = `rgb(${values.join(" ")})`;
      return make("span", {}, `${text} `, swatch, values.join(" "));
    };
    this.pixelText(make("b", { class: person ? "person" : "" }, person ? "person" : "background"),
      make("span", {}, why), colour("here", here), colour(known ? "empty" : "empty, guessed", background),
      ...measures.map((text) => make("span", {}, text)));
  }

  pixelText(...parts) {
    by("pixel").replaceChildren(...parts);
    by("pixel").hidden = parts[0] === "";
    by("hint").hidden = parts[0] !== "";
  }
}
