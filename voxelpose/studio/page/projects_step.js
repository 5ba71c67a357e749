// Projects: what is in the folder, and a new one.

import { getJson, postJson } from "./api.js";
import { button, by, make, notice } from "./elements.js";
import { bin, date, entryActions } from "./entry_actions.js";
import { addressOf } from "./rail.js";
import { picker } from "./uploads.js";

export const verdictTag = (result) => make("b", { class: `tag ${result.level}`, title: result.words }, result.level);

export const resultLink = (step, result) =>
  `#${step}/${encodeURIComponent(result.project ?? "")}/${encodeURIComponent(result.name)}`;

const resultLine = (result) => make("li", {},
  make("span", { title: result.name }, make("a", { href: resultLink("view", result) }, result.name)), make("small", {}, date(result.made)), verdictTag(result));

// The contact sheet of a result.
export const sheet = (result) => result?.sheet && make("img", { src: `sheet?result=${encodeURIComponent(result.name)}`, alt: `Contact sheet of ${result.name}`, loading: "lazy" });

const DEMO = "demo_recording";

export async function projectsStep(studio, state) {
  const name = make("input", { type: "text", id: "new_name", "data-setting": "name", class: "grow", placeholder: "anna_walk_1", "aria-label": "Name of the new project", maxLength: 80 });
  const make_new = async (event) => {
    event.preventDefault();
    if (await studio.send("api/new", { name: name.value.trim() }, event.target)) location.hash = `import/${encodeURIComponent(name.value.trim())}`;
  };
  studio.onFiles(null, async () => studio.uploads.waiting || dispatchEvent(new Event("hashchange")));
  const holder = make("div");
  const trial = make("div", { class: "row wrap" });
  let before = "";
  studio.watch(null, null, async () => {
    const now = JSON.stringify(studio.jobs.map((job) => [job.number, job.state]));
    if (now === before) return;
    const known = before ? getJson("api/state").catch(() => state) : state;
    before = now;
    trial.replaceChildren(...demo(studio, await known));
    const cards = listed(studio, await known);
    if (!holder.querySelector("input")) holder.replaceChildren(...cards); // nobody types a name there
  });
  return [
    make("h2", {}, "Projects"),
    make("details", { open: !state.projects.length, id: "first_steps" }, make("summary", {}, "From videos to motion in three steps"),
      make("div", { class: "inner" }, by("intro").content.cloneNode(true), trial)),
    make("p", { class: "lead" }, `Recordings and results in ${state.folder}`),
    holder,
    make("form", { class: "job", onsubmit: make_new },
      make("h3", {}, "New project"),
      make("div", { class: "row wrap" }, name, button("Make it", () => {}, { class: "main", id: "make_new" }),
        picker("Choose a folder", (files) => studio.uploads.take(files, ""), { webkitdirectory: true, "data-folder": "" })),
      make("p", { class: "note" }, "Type a name, or choose the folder of a recording, or drop it here. A folder of several recordings makes a project of each.")),
    bin(studio, state.bin),
  ].filter(Boolean);
}

const isBusy = (studio, project) => studio.jobs.some((job) => job.of === project && ["running", "waiting"].includes(job.state));

// The program's own recording: tried by one click, followed in the bar.
function demo(studio, state) {
  const result = state.results.find((one) => one.project === DEMO);
  if (result) return [make("a", { class: "button main", id: "see_demo", href: resultLink("view", result) }, "See the demo's result"), verdictTag(result)];
  const busy = isBusy(studio, DEMO);
  return [button("Try the demo", () => studio.send("api/demo", {}), { class: "main", id: "demo", disabled: busy }),
    make("span", { class: "note grow" }, busy ? "The demo is being made: the bar above shows how far it is." : "No videos at hand? A recording by four cameras is made here and its motion estimated, in some minutes.")];
}

// Cards of the projects, and what can be done with all of them.
function listed(studio, state) {
  const of = (project) => state.results.filter((result) => result.project === project.name);
  const cards = state.projects.map((project) => {
    const results = of(project);
    const cameras = `${project.cameras || "no"} camera${project.cameras === 1 ? "" : "s"}`;
    return make("section", { class: "card" },
      sheet(results.find((result) => result.sheet)),
      make("h3", {}, project.name),
      make("p", {}, `${cameras}, ${project.calibrated ? "calibrated" : "no calibration"}`),
      results.length > 0 && make("ul", {}, ...results.map(resultLine)),
      make("a", { class: "button quiet", href: addressOf("import", "", project.name), "aria-label": `Open ${project.name}` }, "Open"),
      entryActions(studio, project.name));
  });
  const others = state.results.filter((result) => !result.project);
  const left = state.projects.filter((project) => project.cameras && !of(project).length && !isBusy(studio, project.name)).map((project) => project.name);
  const all = async () => {
    const { refused } = await postJson("api/fits", { projects: left }).catch((error) => ({ refused: { "": error.message } }));
    notice(Object.entries(refused).map(([project, line]) => `${project}: ${line}`).join("; "));
  };
  return [
    state.projects.length ? make("div", { class: "cards" }, ...cards)
      : make("p", {}, "There is no recording in this folder yet. A new project takes your files in the next step."),
    left.length > 1 && make("div", { class: "row wrap" }, button(`Estimate the ${left.length} without a result`, all, { id: "all" }), make("span", { class: "note grow" }, "One after the other, each with its own settings.")),
    others.length > 0 && make("section", { class: "card" }, make("h3", {}, "Results of recordings elsewhere"), make("ul", {}, ...others.map(resultLine))),
  ].filter(Boolean);
}
