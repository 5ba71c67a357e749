// The rail of the studio's steps, above every page that belongs to one of them.

import { make } from "./elements.js";

export const STEPS = [
  ["projects", "Projects"], ["record", "Record"], ["import", "Import"], ["calibrate", "Calibrate"], ["check", "Check"], ["fit", "Estimate"], ["view", "View"], ["export", "Export"], ["live", "Live"],
];

// Address of a step of a project; `studio` is that of the studio's page.
export function addressOf(step, studio, project) {
  const name = encodeURIComponent(project ?? "");
  if (step === "check") return `${studio}check/${name}/`;
  return project && step !== "projects" ? `${studio}#${step}/${name}` : `${studio}#projects`;
}

// Puts the rail on top; steps of a project are there once one is chosen.
export function addRail(now, studio, project) {
  document.getElementById("rail")?.remove();
  const links = STEPS.map(([step, title], index) => make("li", {},
    step === "projects" || project
      ? make("a", { href: addressOf(step, studio, project), "aria-current": step === now ? "step" : "false" },
        make("i", {}, String(index + 1)), title)
      : make("span", {}, make("i", {}, String(index + 1)), title)));
  document.body.prepend(make("nav", { id: "rail", "aria-label": "Steps" }, make("ol", {}, ...links)));
  document.querySelector("#rail [aria-current=step]")?.scrollIntoView({ block: "nearest", inline: "center" });
}
