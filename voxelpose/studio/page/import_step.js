// Import: files of a project, and what the program reads in them.

import { getJson } from "./api.js";
import { button, make, refusal } from "./elements.js";
import { addressOf } from "./rail.js";
import { dropTarget, fileList, picker, STILLS, VIDEOS } from "./uploads.js";

const PLACES = [
  ["video", "Camera videos", "One for each camera, named as in the calibration: cam_1.mp4, cam_2.mp4 …; or a folder of pictures for each.", VIDEOS, true],
  ["background", "Empty views", "Of each camera, by the same name: a video or a picture without the person. Nothing improves a result more.", `${VIDEOS},${STILLS}`, true],
  ["calibration", "Calibration", "Where the cameras stand: TOML, YAML, JSON, XML, and other programs' files. The next step makes one. One camera needs none.", ".toml,.yml,.yaml,.json,.xml,.txt,.xcp", false],
  ["subject.toml", "Person", "If you have one: subject.toml with stature, chest girth, sex. The next steps ask for them, too.", ".toml", false],
  ["timestamps.csv", "Times", "If frames were not taken together: timestamps.csv with cam_id, frame_time.", ".csv", false],
  ["masks", "Silhouettes", "Instead of videos, if another program made them: a folder of pictures for each camera, in one folder.", VIDEOS, true],
];

export async function importStep(studio, state, project) {
  const holder = make("div");
  const step = { studio, project, holder, renew: () => renew(step), calibrated: state.projects.filter((one) => one.calibrated && one.name !== project).map((one) => one.name) };
  studio.onFiles(() => step.known && draw(step), step.renew);
  await renew(step);
  return [
    make("h2", {}, "Import"),
    make("p", { class: "lead" }, "Choose the recording's folder, or drop it anywhere on this page: each file is copied to its place. A folder of several recordings makes a project of each."),
    make("div", { class: "row end" }, picker("Choose the folder", (files) => studio.uploads.take(files, project), { webkitdirectory: true, "data-folder": "" })),
    holder,
  ];
}

async function renew(step) {
  const asked = (step.asked = getJson(`api/project?project=${encodeURIComponent(step.project)}`));
  const known = await asked;
  if (step.asked !== asked) return; // a later answer counts
  step.known = known;
  draw(step);
}

function draw(step) {
  const { known, project, studio } = step;
  const next = known.fault && !known.files.some((file) => file.place === "calibration") ? "calibrate" : "check";
  step.holder.replaceChildren(
    make("div", { class: "cards" }, ...PLACES.map((place) => card(step, ...place))),
    said(known),
    make("div", { class: "row end" },
      !known.fault && make("a", { class: "button quiet", id: "to_fit", href: addressOf("fit", "./", project) }, "Straight to Estimate"),
      make("a", { class: `button ${known.cameras.length && !studio.uploads.waiting ? "main" : "quiet"}`, id: "next", href: addressOf(next, "./", project) }, next === "check" ? "Next: Check" : "Next: Calibrate")));
}

// What the program's own reader says.
function said({ cameras, fault, frames, fps, notes, command }) {
  if (fault) return make("div", { id: "fault_line" }, refusal(fault));
  const empty = cameras.filter((camera) => camera.empty).length;
  const words = [
    `${cameras.length} camera${cameras.length === 1 ? "" : "s"}, ${frames} frames, ${Number(fps.toFixed(2))} a second`,
    empty === cameras.length ? "an empty view of each" : `${empty || "no"} empty view${empty === 1 ? "" : "s"}: the background is estimated where there is none`,
  ];
  return make("div", { id: "read_line" }, make("p", { class: "fine" }, `Ready: ${words.join("; ")}.`),
    ...(command === "track" ? [make("p", { class: "note" }, "With one camera, distances are only rough; a second one from the side makes the most difference.")] : []),
    ...notes.map((text) => make("p", { class: "note" }, text)));
}

function card(step, place, title, hint, accept, pictures) {
  const files = step.known.files.filter((file) => file.place === place);
  const take = (chosen) => step.studio.uploads.take(chosen, step.project, place);
  const words = pictures ? "Choose files" : "Choose a file";
  return dropTarget(make("section", { class: "card" },
    make("h3", {}, title), make("p", {}, hint), fileList(step, files),
    make("div", { class: "row wrap" },
      picker(words, take, { accept, multiple: pictures, "data-place": place, "aria-label": `${words}: ${title}` }),
      place === "calibration" && !files.length && step.calibrated.length > 0 && fromProject(step),
      pictures && picker("Choose a folder", take, { webkitdirectory: true, "data-folder": place, "aria-label": `Choose a folder: ${title}` }))), take);
}

// The calibration of another project, if the cameras have not been moved since.
function fromProject(step) {
  const select = make("select", { id: "calibration_of", "aria-label": "Project whose calibration is used" }, ...step.calibrated.map((name) => make("option", { value: name }, name)));
  const use = async () => {
    if (await step.studio.send("api/calibration", { project: step.project, of: select.value })) await renew(step);
  };
  return make("span", { class: "row wrap" }, make("small", { class: "note" }, "or that of"), select, button("Use it", use, { id: "use_calibration" }));
}
