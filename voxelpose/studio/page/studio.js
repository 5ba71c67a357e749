// The studio: one step at a time, by the address; the job of the program is followed all the while.

import { getJson, onConnection, postJson } from "./api.js";
import { calibrateStep } from "./calibrate_step.js";
import { by, notice } from "./elements.js";
import { exportStep } from "./export_step.js";
import { fitStep } from "./fit_step.js";
import { errorAtField, isWrong } from "./form_fields.js";
import { importStep } from "./import_step.js";
import { liveStep } from "./live_step.js";
import { projectsStep } from "./projects_step.js";
import { addRail, STEPS } from "./rail.js";
import { recordStep } from "./record_step.js";
import { dropTarget, Uploads } from "./uploads.js";
import { viewStep } from "./view_step.js";

const VIEWS = { projects: projectsStep, record: recordStep, import: importStep, calibrate: calibrateStep, fit: fitStep, view: viewStep, export: exportStep, live: liveStep };

class Studio {
  constructor() {
    this.job = { state: "idle" };
    this.watchers = [];
    this.shown = 0;
    this.uploads = new Uploads(this);
    dropTarget(document.documentElement, (files) => this.uploads.take(files, this.route.project));
    addEventListener("hashchange", () => this.show());
    onConnection((reachable) => notice(reachable ? ""
      : "The program has ended or cannot be reached: start `voxelpose studio` again, then load this page again."));
    this.listen();
    this.show();
  }

  // The job as it goes, also of one that was begun before the page was loaded.
  listen() {
    const events = new EventSource("events");
    events.addEventListener("message", (event) => {
      this.job = JSON.parse(event.data);
      for (const watch of this.watchers) watch(this.job);
    });
    addEventListener("pagehide", () => events.close());
  }

  // The studio as a step sees it: `watch` calls with the job now, and whenever it changes while that
  // step is shown; `onFiles` is told when files are on their way, and when they have come.
  seenBy(watchers) {
    const seen = Object.create(this);
    seen.watch = (call) => {
      watchers.push(call);
      call(this.job);
    };
    seen.onFiles = (draw, renew) => Object.assign(watchers, { draw, renew });
    return seen;
  }

  get route() {
    const [step, project, result] = location.hash.slice(1).split("/").map(decodeURIComponent);
    return { step: step in VIEWS ? step : "projects", project: project || null, result: result || null };
  }

  async show() {
    const { step, project, result } = this.route;
    const mine = ++this.shown;
    const watchers = (this.watchers = []);
    notice("");
    addRail(step, "./", step === "projects" ? null : project);
    document.title = `${project && step !== "projects" ? `${project} – ` : ""}${new Map(STEPS).get(step)} – voxelpose studio`;
    by("where").textContent = step === "projects" ? "" : project ?? "";
    try {
      const state = await getJson("api/state");
      if (mine !== this.shown) return;
      const parts = await VIEWS[step](this.seenBy(watchers), state, project, result);
      if (mine !== this.shown) return; // another step was chosen meanwhile
      by("step").replaceChildren(...parts);
      by("step").scrollTop = 0;
    } catch (error) {
      if (mine !== this.shown) return;
      by("step").replaceChildren();
      notice(error.message);
    }
  }

  // Sends something; what is refused is told at its field in a part of the page, else on top. Returns
  // whether it was taken.
  async send(path, content, holder) {
    try {
      await postJson(path, content);
      notice("");
      return true;
    } catch (error) {
      if (errorAtField(holder, error)) return false;
      notice(error.message);
      by("banner").scrollIntoView({ block: "nearest" });
      return false;
    }
  }

  // Sends a form, unless a field of it holds what it cannot; then shows the panel of the job. Returns
  // whether it was taken.
  async begin(path, content, panel, holder) {
    if (isWrong(holder)) return false;
    const taken = await this.send(path, content, holder);
    if (taken) panel.scrollIntoView({ block: "nearest", behavior: "smooth" });
    return taken;
  }
}

window.studio = new Studio();
