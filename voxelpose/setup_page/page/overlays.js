// What is fetched for the cameras: silhouettes, painted places, the floor.

import { loadImage, postJson } from "./api.js";
import { by, notice } from "./elements.js";
import { Stages, latest } from "./stages.js";

const STAGED = ["background", "odds", "first"];

export class Overlays {
  constructor(app) {
    this.app = app;
    this.keys = {};
    const quiet = () => {};
    this.stages = new Stages(app.views, () => this.request, (text) => text && this.silhouetteText(text));
    this.loadSilhouettes = latest(250, (current) => this.silhouettes(current), (error) => this.silhouetteText(error.message));
    this.loadGround = latest(30, (current) => this.ground(current), (error) => notice(error.message));
    this.loadErrors = latest(200, (current) => this.errors(current), quiet);
    this.forgetPainted();
  }

  // Fetches again what depends on something that has changed.
  update() {
    const { app } = this;
    const { doc, state } = app.store;
    const wanted = app.stage === "picture" ? null : JSON.stringify(this.request);
    if (this.changed("silhouettes", wanted)) {
      if (wanted) this.silhouetteText("Making silhouettes …");
      this.loadSilhouettes();
    }
    this.stages.show(STAGED.includes(app.stage) ? app.stage : null);
    const up = JSON.stringify([app.ground, doc.fit.up, app.height]);
    if (this.changed("ground", up) && app.ground) this.loadGround();
    if (this.changed("errors", JSON.stringify(doc.points)) && !state.refused.points) this.loadErrors();
  }

  changed(name, key) {
    const before = this.keys[name];
    this.keys[name] = key;
    return before !== key;
  }

  async forgetPainted() {
    for (const { name, painted_region, painted_unknown } of this.app.store.state.cameras) {
      const view = this.app.views.get(name);
      const load = (kind) => loadImage(`painted/${kind}/${encodeURIComponent(name)}?${Math.random()}`);
      queueMicrotask(async () => {
        const target = view ?? this.app.views.get(name);
        target.painted = painted_region ? await load("region") : null;
        target.hidden = painted_unknown ? await load("unknown") : null;
        target.draw();
      });
    }
  }

  silhouetteText(text) {
    this.app.silhouetteNote = text;
    const note = by("silhouette_state");
    if (note) note.textContent = text;
  }

  // What backgrounds are taken from.
  get method() {
    const { doc, state } = this.app.store;
    return doc.fit.background ?? state.settings.background?.value ?? "auto";
  }

  // What silhouettes depend on.
  get request() {
    const { regions, unknown } = this.app.store.doc;
    return { moment: this.app.moment, background: this.method, places: { regions, unknown } };
  }

  // Tells what a pixel of a camera is taken for, in the place of the hint; null: no longer.
  explain(asked) {
    const there = asked && !this.app.store.state.masks_only && !by("empty").checked;
    this.stages.explain(there ? asked : null);
  }

  async silhouettes(current) {
    const { app } = this;
    if (app.stage === "picture") return;
    const answer = await this.stages.ready("api/silhouettes", this.request, current);
    if (!answer) return;
    await Promise.all(Object.entries(answer.cameras).map(async ([name, { png }]) => {
      const image = await loadImage(`data:image/png;base64,${png}`);
      if (!current()) return;
      const view = app.views.get(name);
      view.silhouette = image;
      view.draw();
    }));
    if (!current()) return;
    const shares = Object.entries(answer.cameras).map(([name, { share }]) => `${name} ${(100 * share).toFixed(1)} %`);
    const guessed = answer.guessed.length
      ? ` No empty view of ${answer.guessed.join(", ")}: the background is estimated from the frames.` : "";
    this.silhouetteText(`Share of the picture: ${shares.join(", ")}.${guessed} ${answer.note}`);
  }

  async ground(current) {
    const { app } = this;
    const { doc, state } = app.store;
    const up = doc.fit.up ?? state.settings.up?.value ?? null;
    const answer = await postJson("api/ground", { up, height_m: app.height });
    if (!current()) return;
    for (const view of app.views.values()) {
      view.ground = answer.cameras[view.name] || [];
      view.draw();
    }
  }

  async errors(current) {
    const { app } = this;
    const found = await postJson("api/points", { points: app.store.doc.points });
    if (!current()) return;
    app.errors = found;
    app.show();
  }
}
