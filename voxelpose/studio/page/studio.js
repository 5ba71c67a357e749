// The studio: one step at a time, by the address; the program's jobs are followed all the while.

import { getJson, postJson } from "./api.js";
import { calibrateStep } from "./calibrate_step.js";
import { by, notice } from "./elements.js";
import { exportStep } from "./export_step.js";
import { fitStep } from "./fit_step.js";
import { errorAtField, isWrong } from "./form_fields.js";
import { importStep } from "./import_step.js";
import { JobBar, nameOf } from "./job_bar.js";
import { liveStep } from "./live_step.js";
import { projectsStep } from "./projects_step.js";
import { addRail, STEPS } from "./rail.js";
import { recordStep } from "./record_step.js";
import { dropTarget, Uploads } from "./uploads.js";
import { viewStep } from "./view_step.js";

const VIEWS = { projects: projectsStep, record: recordStep, import: importStep, calibrate: calibrateStep, fit: fitStep, view: viewStep, export: exportStep, live: liveStep };

class Studio {
  constructor() {
    this.jobs = [];
    this.watchers = [];
    this.shown = 0;
    this.uploads = new Uploads(this);
    dropTarget(document.documentElement, (files) => this.uploads.take(files, this.route.project));
    addEventListener("hashchange", () => this.show());
    new JobBar("./", (jobs) => {
      this.jobs = jobs;
      for (const watch of this.watchers) watch();
    }, () => by("step").childElementCount || this.show());
    this.show();
  }

  // The studio as a step sees it: `watch` calls with the newest job of some kinds that is done to some
  // things (null: any), and why no other can begin meanwhile, now and whenever that changes while that
  // step is shown; `onFiles` is told when files are on their way, and when they have come.
  seenBy(watchers) {
    const seen = Object.assign(Object.create(this), { show: () => this.show() });
    seen.watch = (kinds, of, call) => {
      let last = "";
      const look = () => {
        const mine = this.jobs.filter((job) => (!kinds || kinds.includes(job.kind)) && (!of || of.includes(job.of)));
        const job = mine.findLast(({ state }) => state !== "waiting") ?? mine[0] ?? { state: "idle" };
        const running = this.jobs.find(({ state }) => state === "running");
        const busy = running ? `The ${nameOf(running.kind)} of ${running.of} is running: wait for its end, or stop it above.` : "";
        const key = JSON.stringify([job, busy, this.jobs.length]);
        if (key === last) return;
        last = key;
        call(job, busy);
      };
      watchers.push(look);
      look();
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

  // Sends a form, unless a field of it holds what it cannot. Returns whether it was taken.
  begin(path, content, holder) {
    return !isWrong(holder) && this.send(path, content, holder);
  }
}

window.studio = new Studio();
