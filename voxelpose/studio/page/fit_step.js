// Estimate: settings in their groups, the estimation as it goes, and the verdict.

import { getJson } from "./api.js";
import { errorAtField, field, grouped, labelled } from "./form_fields.js";
import { jobPanel } from "./job_panel.js";
import { button, freeName, make, refusal } from "./elements.js";
import { resultLink, verdictTag } from "./projects_step.js";
import { addressOf } from "./rail.js";

// `like` is a result whose settings are begun with.
export async function fitStep(studio, state, project, like) {
  const known = await getJson(`api/project?project=${encodeURIComponent(project)}`);
  const step = { studio, state, project, known, command: known.command ?? "fit", typed: {}, holder: make("div"), panel: make("div", { "aria-live": "polite" }) };
  if (like) step.command = state.results.find((result) => result.name === like)?.command ?? step.command;
  step.form = await getJson(`${formPath(step)}&like=${encodeURIComponent(like ?? "")}`);
  if (like) step.typed = Object.fromEntries(step.form.map(({ name, value, usual }) => [name, value === usual ? null : value]));
  draw(step);
  let before = null;
  studio.watch(async (job) => {
    const ended = before === "running" && job.state !== "running";
    before = job.state;
    if (ended) step.state = await getJson("api/state").catch(() => step.state);
    showJob(step, job);
    if (ended) draw(step);
    if (ended && job.state === "failed") errorAtField(step.holder, { field: job.field, message: job.error });
  });
  return [
    make("h2", {}, "Estimate"),
    make("p", { class: "lead" }, "The program finds the person's pose in every frame. The usual settings do in most cases; the height of the person helps most."),
    step.panel, step.holder,
  ];
}

const formPath = (step) => `api/form?project=${encodeURIComponent(step.project)}&command=${step.command}`;

function showJob(step, job) {
  const mine = job.of === step.project && ["fit", "track"].includes(job.kind);
  const shown = mine || job.state === "running";
  step.panel.replaceChildren(...(shown ? [jobPanel(step.studio, job, step.project, () => verdicts(step, job))] : []));
  const start = step.holder.querySelector("#start");
  if (start) start.disabled = job.state === "running" || !step.known.cameras.length;
}

function verdicts(step, job) {
  const result = step.state.results.find((each) => each.name === job.result);
  return result ? [
    make("div", { class: "row wrap verdict" }, make("h3", {}, result.name), verdictTag(result), make("small", { class: "note" }, result.frames)),
    result.words !== result.level && make("p", {}, result.words),
    make("div", { class: "row end" }, make("a", { class: "button main", href: resultLink("view", result), id: "next" }, "Next: View")),
  ].filter(Boolean) : [];
}

function draw(step) {
  const { known, form } = step;
  const taken = step.state.results.map((result) => result.name.split("/")[0]);
  const stem = `${step.project}_${step.command}`;
  const out = make("input", { type: "text", id: "out", "data-setting": "out", value: taken.includes(stem) ? freeName(`${stem}_`, taken, 2) : stem, maxLength: 80 });
  const replace = make("input", { type: "checkbox", id: "replace" });
  const names = known.cameras.map((camera) => camera.name);
  const rows = (row) => field(row.name === "camera" ? { ...row, input: "choice", choices: names, none: names.length > 1 && "choose" } : row, step.typed);
  const groups = grouped(form, rows, methods(step), [labelled("name of the result", out, make("label", { class: "note" }, replace, "replace an earlier result of this name"))]);
  const start = () => step.studio.begin("api/fit", {
    project: step.project, command: step.command, out: out.value.trim(), overwrite: replace.checked, settings: step.typed,
  }, step.panel, step.holder);
  const fault = known.fault && (step.command === "fit" || !known.cameras.length);
  step.holder.replaceChildren(
    ...(fault ? [refusal(known.fault), make("p", {}, make("a", { class: "button main", href: addressOf("import", "./", step.project) }, "Mend it: Import"))] : []),
    ...groups,
    make("div", { class: "row end" }, button("Start", start, { class: "main", id: "start", disabled: step.studio.job.state === "running" || !known.cameras.length })));
}

// Several cameras, or one of them.
function methods(step) {
  if (step.known.cameras.length < 2) return [];
  const select = make("select", { id: "command" }, make("option", { value: "fit" }, "all cameras"), make("option", { value: "track" }, "one camera"));
  select.value = step.command;
  select.addEventListener("change", async () => {
    Object.assign(step, { command: select.value, typed: {} });
    step.form = await getJson(formPath(step));
    draw(step);
  });
  return [labelled("made from", select)];
}
