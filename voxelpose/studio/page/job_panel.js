// What came of a step's job, in that step, and whether another one can begin; the bar shows jobs as they go.

import { make, refusal } from "./elements.js";
import { nameOf } from "./job_bar.js";
import { addressOf, STEPS } from "./rail.js";

const HERE = ["fit", "calibrate", "record", "live"]; // steps that show their own errors, beside the settings

// Parts that tell what came of a job; `done` makes those of a finished one.
export function outcome(job, project, done) {
  if (job.state === "failed") {
    const title = STEPS.find(([step]) => step === job.step)?.[1];
    return [make("section", { class: "job" }, make("h3", {}, `The ${nameOf(job.kind)} of ${job.of} failed`), refusal(job.error),
      title && !HERE.includes(job.step) && make("a", { class: "button main", id: "mend", href: addressOf(job.step, "./", project) }, `Mend it: ${title}`),
      HERE.includes(job.step) && make("p", { class: "note" }, "Change the settings below, then start again."))];
  }
  if (job.state !== "done") return [];
  return [make("section", { class: "job" }, ...done(job), ...job.notes.map((text) => make("p", { class: "note" }, `Note: ${text}`)))];
}

// Lets a button begin something, or says beside it why it cannot.
export function allow(start, reason) {
  start.disabled = Boolean(reason);
  let words = start.previousElementSibling;
  if (!words?.matches(".why")) start.before(words = make("small", { class: "note why" }));
  words.textContent = reason;
}
