// Estimate: settings in their groups, the estimation as it goes, and the verdict.

import { getJson } from "./api.js";
import { errorAtField, field, grouped, labelled } from "./form_fields.js";
import { allow, outcome } from "./job_panel.js";
import { button, make, refusal } from "./elements.js";
import { resultLink, verdictTag } from "./projects_step.js";
import { addressOf } from "./rail.js";

// `like` is a result whose settings are begun with.
export async function fitStep(studio, state, project, like) {
  const known = await getJson(projectPath(project));
  const step = { studio, state, project, known, command: known.command ?? "fit", typed: {}, holder: make("div"), panel: make("div", { "aria-live": "polite" }) };
  if (like) step.command = state.results.find((result) => result.name === like)?.command ?? step.command;
  step.form = await getJson(`${formPath(step)}&like=${encodeURIComponent(like ?? "")}`);
  if (like) step.typed = Object.fromEntries(step.form.map(({ name, value, usual }) => [name, value === usual ? null : value]));
  draw(step);
  let before = null;
  studio.watch(["fit", "track"], [project], async (job, busy) => {
    const changed = before !== job.state;
    const ended = before === "running" && changed;
    before = job.state;
    if (ended) step.state = await getJson("api/state").catch(() => step.state);
    step.panel.replaceChildren(...outcome(job, project, () => verdicts(step, job)));
    step.busy = busy;
    showStart(step);
    if (ended && job.state === "failed") errorAtField(step.holder, { field: job.field, message: job.error });
    if (changed) await renewOut(step).catch(() => {});
  });
  return [
    make("h2", {}, "Estimate"),
    make("p", { class: "lead" }, "The program finds the person's pose in every frame. The usual settings do in most cases; the height of the person helps most."),
    step.panel, step.holder,
  ];
}

const projectPath = (project) => `api/project?project=${encodeURIComponent(project)}`;
const formPath = (step) => `api/form?project=${encodeURIComponent(step.project)}&command=${step.command}`;

// While another job runs, this one waits for it.
function showStart(step) {
  step.start.textContent = step.busy ? "Add to the queue" : "Start";
  allow(step.start, step.known.cameras.length ? "" : "No camera can be read yet: mend it in Import.");
}

// The name that the next result has where none is typed.
async function renewOut(step) {
  step.known.outs = (await getJson(projectPath(step.project))).outs;
  step.out.placeholder = step.known.outs?.[step.command] ?? "";
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
  const out = step.out = make("input", { type: "text", id: "out", "data-setting": "out", placeholder: known.outs?.[step.command] ?? "", maxLength: 80 });
  const replace = make("input", { type: "checkbox", id: "replace", onchange: () => (out.value ||= `${step.project}_${step.command}`) });
  const names = known.cameras.map((camera) => camera.name);
  const rows = (row) => field(row.name === "camera" ? { ...row, input: "choice", choices: names, none: names.length > 1 && "choose" } : row, step.typed);
  const groups = grouped(form, rows, methods(step), [labelled("name of the result", out, make("label", { class: "note" }, replace, "replace an earlier result of this name"))]);
  const begin = () => {
    const asked = { project: step.project, command: step.command, out: out.value.trim(), overwrite: replace.checked, settings: step.typed };
    return step.studio.begin("api/fit", asked, step.holder);
  };
  step.start = button("", begin, { class: "main", id: "start" });
  const fault = known.fault && (step.command === "fit" || !known.cameras.length);
  step.holder.replaceChildren(
    ...(fault ? [refusal(known.fault), make("p", {}, make("a", { class: "button main", href: addressOf("import", "./", step.project) }, "Mend it: Import"))] : []),
    ...groups,
    make("div", { class: "row end" }, step.start));
  showStart(step);
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
