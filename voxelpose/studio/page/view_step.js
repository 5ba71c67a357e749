// View: the results of a project, each with its pictures and its viewer.

import { make } from "./elements.js";
import { comparison } from "./comparison.js";
import { date, entryActions } from "./entry_actions.js";
import { resultLink, sheet, verdictTag } from "./projects_step.js";
import { addressOf } from "./rail.js";

export const viewerPath = (name) => `view/${name.split("/").map(encodeURIComponent).join("/")}/-/`;

export const none = (project) => [
  make("p", {}, "There is no result yet."),
  make("p", {}, make("a", { class: "button main", href: addressOf("fit", "./", project) }, "Go to Estimate")),
];

// Results of a project, or the one that was asked for of a recording elsewhere; that first.
export const resultsOf = (state, project, chosen) => state.results
  .filter((result) => (project ? result.project === project : result.name === chosen))
  .sort((a, b) => (b.name === chosen) - (a.name === chosen));

export async function viewStep(studio, state, project, chosen) {
  const results = resultsOf(state, project, chosen);
  const cards = results.map((result) => make("section", { class: "card" },
    sheet(result),
    make("div", { class: "row wrap" }, make("h3", {}, result.name), verdictTag(result), make("small", { class: "note" }, [result.frames, date(result.made)].filter(Boolean).join(", "))),
    result.words !== result.level && make("p", {}, result.words),
    make("div", { class: "row wrap" },
      make("a", { class: "button main", href: viewerPath(result.name), target: `viewer ${result.name}`, "aria-label": `Open the viewer of ${result.name}` }, "Open the viewer"),
      make("a", { class: "button quiet", href: resultLink("export", result) }, "Next: Export")),
    entryActions(studio, result.name, !result.project ? "" : make("a", { class: "button quiet small", href: resultLink("fit", result), title: "Begin with the settings of this result" }, "Again with other settings"))));
  return [
    make("h2", {}, "View"),
    make("p", { class: "lead" }, "The viewer opens beside this page: cameras, hull, body and skeleton over time. Look before you trust a number."),
    ...(results.length ? [make("div", { class: "cards" }, ...cards), results.length > 1 && comparison(results, viewerPath)].filter(Boolean) : none(project)),
  ];
}
