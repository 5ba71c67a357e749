// The page of the silhouettes: cameras in the middle, stages at the side, time below.

import { CamerasPage, openPage } from "./cameras_page.js";
import { by, make } from "./elements.js";
import { Pointer } from "./pointer.js";
import { STAGES, Stages, stageButtons, stageNames } from "./stages.js";

const NOTHING_DRAWN = { region: { polygons: [], painted: false }, unknown: [], points: [] };

class SilhouettePage extends CamerasPage {
  constructor(state) {
    super(state, "silhouettes", Pointer, ": start `voxelpose view` again.");
    this.state = state;
    this.names = stageNames({ masks: state.masks_only, paper: state.paper, fitted: state.fitted });
    const asked = state.numbers.indexOf(Number(new URLSearchParams(location.search).get("frame") ?? NaN));
    this.stages = new Stages(this.views, () => ({ moment: this.moment }), (text) => (by("note").textContent = text));
    by("tools").append(make("section", { class: "step open" }, make("div", { class: "body" },
      make("p", {}, `How the silhouettes of the shown frame came about, made by the code of fit with ${
        state.fitted ? "the settings of this result" : "its usual settings"}.`),
      make("div", { id: "choices" }), make("p", { id: "said" }), make("p", { id: "note", class: "note", role: "status" }))));
    document.addEventListener("keydown", (event) => {
      if (this.large && this.pointer.key(this.views.get(this.large), event)) event.preventDefault();
    });
    this.enlarge(state.cameras.length === 1 ? state.cameras[0].name : null);
    this.choose(this.names.at(-1));
    this.seek(asked >= 0 ? asked : this.moment);
  }

  scene() {
    return { ...NOTHING_DRAWN, stage: this.stage };
  }

  enlarge(name) {
    this.large = name;
    this.explain(null);
    this.arrange();
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

  pathOf(view) {
    return `picture/${encodeURIComponent(view.name)}?moment=${this.moment}`;
  }

  loadMoment() {
    const number = this.state.numbers[this.moment];
    this.timeText(`frame ${number}  ·  ${(number / this.state.fps).toFixed(2)} s`);
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
}

await openPage(SilhouettePage);
