// The studio: one step at a time, by the address; the job of the program is followed all the while.

import { getJson, onConnection, postJson } from "./api.js";
import { calibrateStep } from "./calibrate_step.js";
import { exportStep } from "./export_step.js";
import { fitStep } from "./fit_step.js";
import { importStep } from "./import_step.js";
import { liveStep } from "./live_step.js";
import { projectsStep } from "./projects_step.js";
import { addRail } from "./rail.js";
import { recordStep } from "./record_step.js";
import { viewStep } from "./view_step.js";

const by = (id) => document.getElementById(id);
const VIEWS = { projects: projectsStep, record: recordStep, import: importStep, calibrate: calibrateStep, fit: fitStep, view: viewStep, export: exportStep, live: liveStep };
const TITLES = { projects: "Projects", record: "Record", import: "Import", calibrate: "Calibrate", fit: "Fit", view: "View", export: "Export", live: "Live" };

class Studio {
  constructor() {
    this.job = { state: "idle" };
    this.watchers = [];
    this.shown = 0;
    addEventListener("hashchange", () => this.show());
    onConnection((reachable) => this.notice(reachable ? ""
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
  // step is shown.
  seenBy(watchers) {
    const seen = Object.create(this);
    seen.watch = (call) => {
      watchers.push(call);
      call(this.job);
    };
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
    this.notice("");
    addRail(step, "./", step === "projects" ? null : project);
    document.title = `${project && step !== "projects" ? `${project} – ` : ""}${TITLES[step]} – voxelpose studio`;
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
      this.notice(error.message);
    }
  }

  notice(text) {
    by("banner").hidden = !text;
    by("banner").textContent = text;
  }

  // Sends something; what is refused is told on top. Returns whether it was taken.
  async send(path, content) {
    try {
      await postJson(path, content);
      this.notice("");
      return true;
    } catch (error) {
      this.notice(error.message);
      by("banner").scrollIntoView({ block: "nearest" });
      return false;
    }
  }
}

window.studio = new Studio();
