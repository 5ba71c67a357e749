// The page of the silhouettes: cameras in the middle, stages at the side, time below.

import { getJson, loadImage, onConnection } from "./api.js";
import { addCameras, addMoments, arrange } from "./arrange.js";
import { make } from "./parts.js";
import { Pointer } from "./pointer.js";
import { STAGES, Stages, latest, stageButtons, stageNames } from "./stages.js";

const by = (id) => document.getElementById(id);
const NOTHING_DRAWN = { region: { polygons: [], painted: false }, unknown: [], points: [] };

class App {
  constructor(state) {
    this.state = state;
    this.views = new Map();
    this.large = null;
    this.names = stageNames({ masks: state.masks_only, paper: state.paper, fitted: state.fitted });
    this.stage = this.names.at(-1);
    const asked = state.numbers.indexOf(Number(new URLSearchParams(location.search).get("frame") ?? NaN));
    this.moment = asked >= 0 ? asked : Math.floor(state.moments / 2);
    this.pointer = new Pointer(this);
    this.stages = new Stages(this.views, () => ({ moment: this.moment }), (text) => (by("note").textContent = text));
    this.loadPictures = latest(60, (current) => this.pictures(current), (error) => this.notice(error.message));
    this.build();
    this.choose(this.stage);
    this.seek(this.moment);
  }

  build() {
    const { state } = this;
    by("recording").textContent = state.name;
    by("recording").title = state.folder;
    by("made").textContent = `How the silhouettes of the shown frame came about, made by the code of fit with ${
      state.fitted ? "the settings of this result" : "its usual settings"}.`;
    document.title = `${state.name} – voxelpose silhouettes`;
    addCameras(this, state.cameras, () => ({ ...NOTHING_DRAWN, stage: this.stage }));
    addMoments(this, state.moments);
    addEventListener("resize", () => arrange(by("tiles"), this.views, this.large));
    document.addEventListener("keydown", (event) => {
      if (this.large && this.pointer.key(this.views.get(this.large), event)) event.preventDefault();
    });
    onConnection((reachable) => (reachable ? (by("banner").hidden = true) : this.notice(
      "The program has ended or cannot be reached: start `voxelpose view` again.")));
    this.enlarge(state.cameras.length === 1 ? state.cameras[0].name : null);
  }

  notice(text) {
    by("banner").hidden = false;
    by("banner").textContent = text;
  }

  enlarge(name) {
    this.large = name;
    this.explain(null);
    arrange(by("tiles"), this.views, name);
    const click = this.views.size > 1 ? "Click a camera to enlarge it." : "Click the picture to look into it.";
    const point = this.state.masks_only ? "" : "Point at a pixel: this line tells what it is taken for, and why. ";
    by("hint").textContent = name ? `${point}Wheel zooms, dragging moves the picture, Esc goes back.` : click;
  }

  choose(stage) {
    this.stage = stage;
    by("choices").replaceChildren(stageButtons(this.names, stage, (name) => this.choose(name)));
    by("said").replaceChildren(make("span", {}, STAGES[stage][1]));
    this.update();
  }

  seek(moment) {
    const { numbers, fps, moments } = this.state;
    this.moment = Math.min(Math.max(moment, 0), moments - 1);
    by("moment").value = this.moment;
    by("moment_text").textContent = `frame ${numbers[this.moment]}  ·  ${(numbers[this.moment] / fps).toFixed(2)} s`;
    by("loading").hidden = false;
    this.loadPictures();
    this.update();
  }

  update() {
    this.stages.show(this.stage === "picture" ? null : this.stage);
    for (const view of this.views.values()) view.draw();
  }

  // Of masks there is nothing to explain. What the fit made of a pixel is told where it is shown.
  explain(pixel) {
    const stage = this.stage === "body" ? "body" : null;
    this.stages.explain(pixel && !this.state.masks_only ? { ...pixel, stage } : null);
  }

  async pictures(current) {
    try {
      await Promise.all([...this.views.values()].map(async (view) => {
        const image = await loadImage(`picture/${encodeURIComponent(view.name)}?moment=${this.moment}`);
        if (!current()) return;
        view.image = image;
        view.draw();
      }));
    } finally {
      if (current()) by("loading").hidden = true;
    }
  }
}

try {
  window.app = new App(await getJson("api/state"));
} catch (error) {
  by("banner").hidden = false;
  by("banner").textContent = error.message;
}
