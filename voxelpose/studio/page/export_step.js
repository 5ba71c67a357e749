// Export: formats to choose, what of the motion, and one archive to keep.

import { outcome } from "./job_panel.js";
import { button, make } from "./elements.js";
import { field, grouped, labelled } from "./form_fields.js";
import { none, resultsOf } from "./view_step.js";

const USUAL = ["bvh", "glb", "csv", "html"];

export async function exportStep(studio, state, project, chosen) {
  const results = resultsOf(state, project, chosen);
  if (!results.length) return [make("h2", {}, "Export"), ...none(project)];
  const select = make("select", { id: "result" }, ...results.map((result) => make("option", { value: result.name }, result.name)));
  const person = make("select", { id: "person" }), whom = labelled("person", person), typed = {};
  const drawPeople = () => {
    const people = results.find((result) => result.name === select.value).people ?? [];
    person.replaceChildren(make("option", { value: "" }, "everybody"), ...people.map((name) => make("option", { value: name }, name)));
    whom.hidden = !people.length;
  };
  select.addEventListener("change", drawPeople);
  drawPeople();
  const settings = make("div", {}, ...grouped(state.export, (row) => field(row, typed), [labelled("result", select), whom]));
  const box = (name, title, words, checked) => make("label", {}, make("input", { type: "checkbox", name, checked, "data-format": name }), make("span", {}, title, make("small", {}, words)));
  const formats = Object.entries(state.formats).map(([name, words]) => box(name, name, words, USUAL.includes(name)));
  const more = [
    box("report", "report", "report.html: angles, quality and advice in one page for every browser", true),
    box("pictures", "pictures", "contact sheet and overlay videos, as they were drawn with the result", false),
  ];
  const panel = make("div", { "aria-live": "polite" });
  const isOn = (name) => document.querySelector(`[data-format=${name}]`).checked;
  let awaited = null; // the result whose archive is downloaded as soon as it is made
  const start = button("Export and download", async () => {
    const asked = { result: select.value, formats: Object.keys(state.formats).filter(isOn), report: isOn("report"), pictures: isOn("pictures"), person: person.value, settings: typed };
    if (await studio.begin("api/export", asked, settings)) awaited = asked.result;
  }, { class: "main", id: "start" });
  const finished = (job) => {
    const query = `result=${encodeURIComponent(job.of)}`;
    return [
      make("h3", {}, `${job.of} is exported`),
      make("p", {}, `${job.files.join(", ")}; ${(job.bytes / 1e6).toFixed(1)} MB, downloaded as one archive. The files are in the result's folder, too.`),
      make("div", { class: "row end" },
        job.files.includes("report.html") && make("a", { class: "button quiet", href: `report?${query}`, target: "report" }, "Open the report"),
        make("a", { class: "button main", id: "download", href: `download?${query}`, download: "" }, "Download again")),
    ];
  };
  studio.watch(["export"], results.map((result) => result.name), (job, busy) => {
    panel.replaceChildren(...outcome(job, project, finished));
    start.textContent = busy ? "Add to the queue" : "Export and download";
    if (["done", "failed", "stopped"].includes(job.state) && job.of === awaited) {
      awaited = null;
      if (job.state === "done") panel.querySelector("#download").click();
    }
  });
  return [
    make("h2", {}, "Export"),
    make("p", { class: "lead" }, "One archive with the formats that you choose."),
    panel,
    settings,
    make("section", { class: "group" }, make("div", { class: "formats" }, ...formats, ...more)),
    make("div", { class: "row end" }, start),
  ];
}
