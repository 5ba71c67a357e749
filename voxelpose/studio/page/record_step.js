// Record: cameras, their pictures, and all of them recorded together.

import { getJson } from "./api.js";
import { coverage } from "./calibration_findings.js";
import { cameraRows } from "./camera_rows.js";
import { allow, outcome } from "./job_panel.js";
import { button, make, notice } from "./elements.js";
import { labelled, loopField } from "./form_fields.js";
import { addressOf } from "./rail.js";

const WHAT = {
  take: ["the take", "First the empty view, then the person: into this project, for Check and Estimate."],
  boards: ["the board before each camera", "A picture every 0.7 seconds, for the lenses in Calibrate: near and far, in all parts of the picture, tilted."],
  board_walk: ["the carried board", "First on the floor, then slowly through the room, for the positions in Calibrate."],
};
const NEXT = { take: ["check", "Next: Check"], boards: ["calibrate", "Next: Calibrate"], board_walk: ["calibrate", "Next: Calibrate"] };
const SAID = {
  preview: () => "These are the pictures. Is the whole room in them, and is each camera the one that its name says?",
  "step out": (left) => `Step out of all pictures: ${left}`,
  "empty view": (left) => `The empty view is recorded, stay out: ${left}`,
  "step in": (left) => `Now step in: ${left}`,
  recording: (left) => `Recording${left === null ? "" : `, ${left} s left`}`,
};

export async function recordStep(studio, state, project) {
  const known = await getJson(`api/cameras?project=${encodeURIComponent(project)}`);
  const step = { studio, project, known, panel: make("div", { "aria-live": "polite" }), holder: make("div"), tiles: new Map() };
  step.rows = cameraRows(known);
  const set = step.set = { what: "take", countdown: 5, empty: 2, length: null, loop: true, replace: false };
  const form = settings(step);
  const open = async () => {
    const sources = step.rows.sources();
    if (!sources.length) return notice("add a camera first: a webcam, the address of a stream, or a video");
    await studio.begin("api/record", { project, sources, ...set }, step.holder);
  };
  step.start = button("Open the cameras", open, { class: "main", id: "open_cameras" });
  step.holder.append(make("section", { class: "job" }, make("h3", {}, "Cameras"), step.rows.element), form, make("div", { class: "row end" }, step.start));
  studio.watch(["recording"], [project], (job, busy) => show(step, job, busy));
  return [
    make("h2", {}, "Record"),
    make("p", { class: "lead" }, "Cameras at this machine or in its network, all recorded together. You have files already? Then go on to Import."),
    step.panel, step.holder,
    make("div", { class: "row end" }, make("a", { class: "button quiet", href: addressOf("import", "./", project) }, "Next: Import")),
  ];
}

function settings(step) {
  const { set } = step;
  const words = make("p", { class: "note" });
  const replace = make("label", { class: "note" }, make("input", { type: "checkbox", id: "replace", onchange: (event) => (set.replace = event.target.checked) }), "");
  const explain = () => {
    const there = step.known.there[set.what];
    words.textContent = WHAT[set.what][1] + (set.what === "take" ? "" : step.known.board ? " Where it was seen is shown meanwhile." : " Say in Calibrate what it looks like, then it is shown where it was seen.");
    replace.hidden = !there.length;
    replace.lastChild.textContent = `replace what is there: ${there.join(", ")}`;
    empty.hidden = set.what !== "take";
  };
  const what = make("select", { id: "what" }, ...Object.entries(WHAT).map(([name, [title]]) => make("option", { value: name }, title)));
  what.addEventListener("change", () => {
    set.what = what.value;
    explain();
  });
  const seconds = (name, title, help, most) => {
    const input = make("input", { type: "number", id: `record_${name}`, value: set[name] ?? "", min: name === "length" ? 0.1 : 0, max: most, step: "any", placeholder: "until Finish" });
    input.addEventListener("change", () => (set[name] = input.value === "" ? (name === "length" ? null : 0) : Number(input.value)));
    return labelled(title, input, make("p", { class: "note" }, help));
  };
  const empty = seconds("empty", "empty view, s", "How long the room without you is recorded; 0 leaves it out. Nothing improves a result more.", 3600);
  const form = make("section", { class: "group" }, make("div", { class: "fields" },
    labelled("what is recorded", what, words, replace),
    seconds("countdown", "countdown, s", "Time to step out of the pictures, and into them again.", 3600), empty,
    seconds("length", "length, s", "How long is recorded.", 36000),
    loopField("record_loop", (on) => (set.loop = on))));
  explain();
  return form;
}

function show(step, job, busy) {
  const running = job.state === "running";
  allow(step.start, busy);
  step.holder.hidden = running;
  if (running) return preview(step, job);
  step.tiles.clear();
  step.shown = null;
  const done = () => {
    const [where, words] = NEXT[job.what] ?? NEXT.take;
    return [make("h3", {}, "Recorded"),
      make("p", { class: "fine", id: "recorded" }, `${job.moments} moments in ${job.seconds.toFixed(1)} s${job.lost ? `; ${job.lost} were left out, as the disk was too slow` : ""}.`),
      make("div", { class: "row end" }, make("a", { class: "button main", id: "next", href: addressOf(where, "./", step.project) }, words))];
  };
  step.panel.replaceChildren(...outcome(job, step.project, done));
}

// Pictures and buttons while cameras are open; the elements stay, so that a button can be pressed.
function preview(step, job) {
  if (!step.shown) {
    const ask = (word) => () => step.studio.send("api/ask", { word });
    step.words = make("p", { class: "phase", id: "phase" });
    step.grid = make("div", { class: "cards cameras" });
    step.record = button("Record", ask("record"), { class: "main record", id: "record" });
    step.finish = button("Finish and keep", ask("finish"), { class: "main", id: "finish" });
    const cancel = button("Cancel", () => step.studio.send("api/stop", { number: job.number }), { class: "quiet", id: "stop" });
    step.shown = make("section", { class: "job", "aria-label": "Cameras" }, step.words, step.grid, make("div", { class: "row end" }, cancel, step.record, step.finish));
    step.panel.replaceChildren(step.shown);
  }
  const { phase } = job;
  const left = job.phase_left_s === null || job.phase_left_s === undefined ? null : Math.ceil(job.phase_left_s);
  step.words.textContent = phase ? SAID[phase](left) + (phase === "recording" ? `: ${job.moments} moments` : "") : "Opening the cameras …";
  step.words.classList.toggle("live", phase === "recording");
  step.words.classList.toggle("waits", phase === "step out" || phase === "empty view" || phase === "step in");
  step.record.hidden = phase !== "preview";
  step.record.disabled = !job.cameras?.every((camera) => camera.pictures > 0);
  step.finish.hidden = phase !== "recording";
  step.finish.disabled = !(job.moments > 1);
  for (const camera of job.cameras ?? []) tile(step, camera);
}

function tile(step, camera) {
  let known = step.tiles.get(camera.name);
  if (!known) {
    known = { image: make("img", { alt: `Picture of ${camera.name}` }), stage: make("div", { class: "coverage" }), words: make("p", { class: "note" }), count: -1 };
    for (const end of ["load", "error"]) known.image.addEventListener(end, () => (known.loading = false));
    step.tiles.set(camera.name, known);
    step.grid.append(make("section", { class: "card", "data-camera": camera.name }, make("h3", {}, camera.name), known.stage, known.words));
    known.stage.append(known.image);
  }
  const good = camera.state === "ok" || camera.state === "ended";
  known.words.textContent = camera.size && good ? `${camera.size.join(" × ")}${camera.state === "ended" ? ", the video has ended" : ""}` : camera.state;
  if (camera.corners_per_cell) {
    known.words.append(camera.sees ? ", sees the board" : ", no board");
    known.stage.classList.toggle("sees", camera.sees);
    if (camera.corners_per_cell.flat().some(Boolean)) known.stage.replaceChildren(known.image, coverage(camera));
  }
  known.words.classList.toggle("bad", !good && camera.state !== "connecting");
  if (camera.pictures && camera.pictures !== known.count && !known.loading) {
    Object.assign(known, { count: camera.pictures, loading: true });
    known.image.src = `preview?${new URLSearchParams({ camera: camera.name, number: camera.pictures })}`;
  }
}
