// Projects: what is in the folder, and a new one.

import { button, make } from "./elements.js";
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

export async function projectsStep(studio, state) {
  const name = make("input", { type: "text", id: "new_name", "data-setting": "name", class: "grow", placeholder: "anna_walk_1", "aria-label": "Name of the new project", maxLength: 80 });
  const make_new = async (event) => {
    event.preventDefault();
    if (await studio.send("api/new", { name: name.value.trim() }, event.target)) location.hash = `import/${encodeURIComponent(name.value.trim())}`;
  };
  const cards = state.projects.map((project) => {
    const results = state.results.filter((result) => result.project === project.name);
    const cameras = `${project.cameras || "no"} camera${project.cameras === 1 ? "" : "s"}`;
    return make("section", { class: "card" },
      sheet(results.find((result) => result.sheet)),
      make("h3", {}, project.name),
      make("p", {}, `${cameras}, ${project.calibrated ? "calibrated" : "no calibration"}`),
      results.length > 0 && make("ul", {}, ...results.map(resultLine)),
      make("a", { class: "button quiet", href: addressOf("import", "", project.name), "aria-label": `Open ${project.name}` }, "Open"),
      entryActions(studio, project.name));
  });
  studio.onFiles(null, async () => studio.uploads.waiting || dispatchEvent(new Event("hashchange")));
  const others = state.results.filter((result) => !result.project);
  return [
    make("h2", {}, "Projects"),
    make("p", { class: "lead" }, `Recordings and results in ${state.folder}`),
    state.projects.length ? make("div", { class: "cards" }, ...cards)
      : make("p", {}, "There is no recording in this folder yet. A new project takes your files in the next step."),
    others.length > 0 && make("section", { class: "card" }, make("h3", {}, "Results of recordings elsewhere"), make("ul", {}, ...others.map(resultLine))),
    make("form", { class: "job", onsubmit: make_new },
      make("h3", {}, "New project"),
      make("div", { class: "row wrap" }, name, button("Make it", () => {}, { class: "main", id: "make_new" }),
        picker("Choose a folder", (files) => studio.uploads.take(files, ""), { webkitdirectory: true, "data-folder": "" })),
      make("p", { class: "note" }, "Type a name, or choose the folder of a recording, or drop it here. A folder of several recordings makes a project of each.")),
    bin(studio, state.bin),
  ].filter(Boolean);
}
