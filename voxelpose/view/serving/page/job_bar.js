// The bar of the program's jobs on every page of the studio: what runs and how far it is, what waits,
// what came of the others; and whether the program answers at all.

import { getJson, postJson } from "./api.js";
import { button, by, make, notice } from "./elements.js";
import { addressOf } from "./rail.js";

const VERBS = {
  fit: "Estimating", track: "Estimating", export: "Exporting", check: "Checking the cameras of",
  recording: "Recording", "live session": "Live session of", "lens calibration": "Calibrating the lenses of", "position calibration": "Calibrating the positions of", synchronisation: "Putting in step the cameras of", "board synchronisation": "Putting in step the board's videos of",
};
const STEPS = { fit: "fit", track: "fit", export: "export", check: "check", recording: "record", "live session": "live" }; // else calibrate
// What a page calls a kind of job.
export const nameOf = (kind) => (["fit", "track"].includes(kind) ? "estimation" : kind);
const ENDS = { done: "is done", failed: "failed", stopped: "was stopped; nothing was written", interrupted: "was interrupted when the program ended" };
const SILENT_MS = 2000; // without a sign of life
const LOOK_MS = 250;

function duration(seconds) {
  if (seconds < 50) return `${Math.max(5, Math.ceil(seconds / 5) * 5)} s`;
  return seconds < 3000 ? `${Math.ceil(seconds / 60)} min` : `${(seconds / 3600).toFixed(1)} h`;
}

// The bar of the studio that has opened a page below its own address, unless within another page;
// returns the studio's address.
export function barOfStudio() {
  const [, studio] = /^(.*\/)(?:view\/.+|live)\/-\/$/.exec(location.pathname) ?? [];
  if (studio && window.top === window) new JobBar(studio);
  return studio;
}

export class JobBar {
  // `studio` is the address of its page, null where there is none; `told` is called with all jobs
  // whenever one changes, `mended` when the program answers again.
  constructor(studio, told = () => {}, mended = () => {}) {
    Object.assign(this, { studio, program: studio ?? "./", told, mended, known: new Map(), jobs: [], seen: Date.now(), open: false, drawn: "" });
    this.lost = make("p", { id: "lost", role: "alert", hidden: true });
    this.rows = make("ol");
    document.head.append(make("link", { rel: "stylesheet", href: "job_bar.css" }));
    document.querySelector("header").after(make("section", { id: "jobs", "aria-label": "Jobs" }, this.lost, this.rows));
    this.listen();
    setInterval(() => !this.asking && !document.hidden && Date.now() - this.seen > SILENT_MS && this.lose(), LOOK_MS);
    addEventListener("pagehide", () => this.events.close());
    // Browsers keep six connections to a program: tabs that nobody looks at leave theirs to others.
    document.addEventListener("visibilitychange", () => (document.hidden ? this.events.close() : !this.asking && this.listen()));
  }

  listen() {
    this.seen = Date.now();
    this.events?.close();
    this.events = new EventSource(`${this.program}events`);
    this.events.addEventListener("beat", () => (this.seen = Date.now()));
    this.events.addEventListener("error", () => this.lose());
    this.events.addEventListener("message", (event) => {
      this.seen = Date.now();
      const { order, changed } = JSON.parse(event.data);
      for (const job of changed) this.known.set(job.number, job);
      this.jobs = order.map((number) => this.known.get(number));
      this.draw();
      this.told(this.jobs);
    });
  }

  // Says that the program does not answer, and asks until it does.
  async lose() {
    if (this.asking) return;
    this.asking = true;
    this.events.close();
    this.known.clear();
    this.rows.hidden = true;
    for (let error = new Error("the program does not answer"); error;) {
      this.lost.hidden = false;
      this.lost.textContent = `No connection: ${error.message}. What you typed stays here; this page goes on by itself.`;
      await new Promise((done) => setTimeout(done, 4 * LOOK_MS));
      error = await getJson(`${this.program}api/state`).then(() => null, (failed) => failed);
    }
    this.lost.hidden = true;
    this.rows.hidden = this.asking = false;
    this.listen();
    this.mended();
  }

  // The rows stay while the jobs are the same, so that their buttons can be pressed.
  draw() {
    const running = this.jobs.find((job) => job.state === "running");
    const waiting = this.jobs.filter((job) => job.state === "waiting");
    const ended = this.jobs.filter((job) => job !== running && !waiting.includes(job)).reverse();
    const all = [running, ...waiting, ...ended].filter(Boolean);
    const key = JSON.stringify([this.open, all.map((job) => [job.number, job.state])]);
    if (key !== this.drawn) {
      this.drawn = key;
      const focus = document.activeElement?.id;
      this.rows.replaceChildren(...all.slice(0, this.open ? all.length : 1).map((job) => this.row(job, waiting)));
      if (all.length > 1) this.rows.firstChild.append(this.more(all.slice(1)));
      const interrupted = ended.filter((job) => job.state === "interrupted" && job.repeatable).reverse();
      if (interrupted.length > 1) this.rows.firstChild.append(button(`Begin all ${interrupted.length} again`, async () => {
        for (const { number } of interrupted) await this.send("api/repeat", { number });
      }, { class: "quiet small", id: "repeat_all" }));
      if (focus) this.rows.querySelector(`#${CSS.escape(focus)}`)?.focus();
    }
    if (!running) return;
    const steps = running.total ? `, ${running.done} of ${running.total}` : "";
    by("stage_line").textContent = `${running.stage}${steps}${running.left_s ? ` · about ${duration(running.left_s)} left` : ""}`;
    const bar = this.rows.querySelector("progress");
    if (running.part !== null) bar.value = running.part;
    else if (running.total) bar.value = running.done / running.total;
    else bar.removeAttribute("value");
  }

  row(job, waiting) {
    const kind = nameOf(job.kind);
    const of = job.into ? `${job.of} into ${job.into}` : job.of;
    const words = { running: `${VERBS[job.kind]} ${of}`, waiting: `Then the ${kind} of ${of}` }[job.state] ?? `The ${kind} of ${of} ${ENDS[job.state]}`;
    const act = (name, text, path, asked, title = text) => button(text, () => this.send(path, asked), { class: "quiet small", id: `${name}_${job.number}`, "aria-label": `${title}: ${kind} of ${of}`, title });
    const place = waiting.indexOf(job);
    const put = (name, text, title, number, before) => number && before && act(name, text, "api/queue", { number: number.number, other: before.number }, title);
    const begun = job.state === "running" || job.state === "waiting";
    return make("li", { class: job.state, "data-job-number": job.number },
      make("a", this.studio === null ? {} : { href: this.address(job) }, words),
      ...(job.state === "running" ? [make("progress", { "aria-label": words }), make("small", { id: "stage_line" })] : []),
      job.error && make("small", { title: job.error }, job.error),
      ...(job.state === "waiting" ? [put("earlier", "↑", "Earlier", job, waiting[place - 1]), put("later", "↓", "Later", waiting[place + 1], job)] : []),
      !begun && job.state !== "done" && job.repeatable && act("repeat", "Begin again", "api/repeat", { number: job.number }),
      act("stop", job.state === "running" ? "Stop" : begun ? "Take out" : "×", "api/stop", { number: job.number }, job.state === "running" ? "Stop" : begun ? "Take out" : "Do not show any more"));
  }

  more(others) {
    const counts = Object.entries(Object.groupBy(others, (job) => job.state)).map(([state, jobs]) => `${jobs.length} ${state}`);
    return button(this.open ? "Less" : counts.join(", "), () => {
      this.open = !this.open;
      this.draw();
    }, { class: "quiet small", id: "more_jobs", "aria-expanded": this.open });
  }

  // Where a job is begun and watched; of one that is done, where its result is shown.
  address(job) {
    if (job.state === "done" && job.result) return `${this.studio}#view/${encodeURIComponent(job.project)}/${encodeURIComponent(job.result)}`;
    return addressOf(job.state === "failed" && job.step ? job.step : STEPS[job.kind] ?? "calibrate", this.studio, job.project) + (job.kind === "export" ? `/${encodeURIComponent(job.of)}` : "");
  }

  send(path, asked) {
    return postJson(`${this.program}${path}`, asked).catch((error) => notice(error.message));
  }
}
