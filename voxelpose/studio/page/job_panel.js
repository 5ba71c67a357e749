// The program's job: how far it is, and what came of it.

import { button, make, refusal } from "./elements.js";
import { addressOf, STEPS } from "./rail.js";

const VERBS = {
  fit: "Fitting", track: "Tracking", export: "Exporting", check: "Checking the cameras of",
  recording: "Recording", "live session": "Live session of", "lens calibration": "Calibrating the lenses of", "position calibration": "Calibrating the positions of", synchronisation: "Putting in step the cameras of", "board synchronisation": "Putting in step the board's videos of",
};
const HERE = ["fit", "calibrate", "record", "live"]; // steps that show their own errors, beside the settings

export function duration(seconds) {
  if (seconds < 50) return `${Math.max(5, Math.ceil(seconds / 5) * 5)} s`;
  return seconds < 3000 ? `${Math.ceil(seconds / 60)} min` : `${(seconds / 3600).toFixed(1)} h`;
}

// Parts of a panel on a job; `done` makes those of a finished one.
export function jobPanel(studio, job, project, done) {
  if (job.state === "running") {
    const steps = job.total ? `, ${job.done} of ${job.total}` : "";
    const left = job.left_s ? ` · about ${duration(job.left_s)} left` : "";
    return make("section", { class: "job", "aria-label": "Progress" },
      make("h3", {}, `${VERBS[job.kind]} ${job.of}`),
      make("progress", job.part === null ? (job.total ? { max: job.total, value: job.done } : {}) : { max: 1, value: job.part }),
      make("div", { class: "row" }, make("p", { class: "note grow", id: "stage_line" }, `${job.stage}${steps}${left}`),
        button("Stop", () => studio.send("api/stop", {}), { class: "quiet", id: "stop" })),
      ...notes(job));
  }
  if (job.state === "failed") {
    const title = STEPS.find(([step]) => step === job.step)?.[1];
    return make("section", { class: "job" }, make("h3", {}, `The ${job.kind} of ${job.of} failed`), refusal(job.error),
      title && !HERE.includes(job.step) && make("a", { class: "button main", id: "mend", href: addressOf(job.step, "./", project) }, `Mend it: ${title}`),
      HERE.includes(job.step) && make("p", { class: "note" }, "Change the settings below, then start again."));
  }
  if (job.state === "stopped") return make("section", { class: "job" }, make("p", {}, `The ${job.kind} of ${job.of} was stopped; nothing was written.`));
  return make("section", { class: "job" }, ...done(job), ...notes(job));
}

const notes = (job) => (job.notes ?? []).map((text) => make("p", { class: "note" }, `Note: ${text}`));
