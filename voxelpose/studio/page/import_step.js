// Import: files of a project, and what the program reads in them.

import { getJson, postJson } from "./api.js";
import { button, make, refusal } from "./parts.js";
import { addressOf } from "./rail.js";

const VIDEOS = ".mp4,.avi,.mov,.mkv,.m4v,.webm,.mpg,.mpeg,.wmv,.mts,.m2ts,.ts,.3gp,.ogv";
const PLACES = [
  ["video", "Camera videos", "One for each camera, named as in the calibration: cam_1.mp4, cam_2.mp4 …", VIDEOS],
  ["background", "Empty views", "Of each camera, by the same name: a video or a picture without the person. Nothing improves a result more.", `${VIDEOS},.png,.jpg,.jpeg,.bmp,.tif,.tiff,.webp`],
  ["calibration", "Calibration", "Where the cameras stand: TOML, YAML, JSON, XML, and other programs' files. One camera needs none.", ".toml,.yml,.yaml,.json,.xml,.txt,.xcp"],
  ["subject.toml", "Person", "If you have one: subject.toml with stature, chest girth, sex. The next steps ask for them, too.", ".toml"],
  ["timestamps.csv", "Times", "If frames were not taken together: timestamps.csv with cam_id, frame_time.", ".csv"],
];
const megabytes = (bytes) => (bytes === null ? "" : bytes < 1e5 ? `${Math.ceil(bytes / 1e3)} kB` : `${(bytes / 1e6).toFixed(1)} MB`);

export async function importStep(studio, state, project) {
  const holder = make("div");
  const step = { studio, project, holder, queue: [], busy: null, refused: [] };
  await renew(step);
  return [make("h2", {}, "Import"), make("p", { class: "lead" }, "Choose the files, or drop them here. They are copied into the project's folder."), holder];
}

async function renew(step) {
  step.known = await getJson(`api/project?project=${encodeURIComponent(step.project)}`);
  draw(step);
}

function draw(step) {
  const { known, project } = step;
  const waiting = step.busy || step.queue.length;
  step.holder.replaceChildren(
    make("div", { class: "cards" }, ...PLACES.map((place) => card(step, ...place))),
    ...step.refused.map(refusal),
    said(known),
    make("div", { class: "row end" },
      make("a", { class: `button ${known.cameras.length && !waiting ? "main" : "quiet"}`, id: "next", href: addressOf("check", "./", project) }, "Next: Check")));
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

function card(step, place, title, hint, accept) {
  const files = step.known.files.filter((file) => file.place === place);
  const many = place === "video" || place === "background";
  const input = make("input", { type: "file", accept, multiple: many, "data-place": place, "aria-label": `Choose files: ${title}` });
  input.addEventListener("change", () => add(step, place, input.files));
  const element = make("section", { class: "card" },
    make("h3", {}, title), make("p", {}, hint),
    files.length > 0 && make("ul", {}, ...files.map((file) => make("li", {},
      make("span", { title: file.name }, file.name.split("/").at(-1)), make("small", {}, megabytes(file.bytes)),
      file.bytes !== null && button("Remove", () => remove(step, file), { class: "quiet small", "aria-label": `Remove ${file.name}` })))),
    step.busy?.place === place && make("div", {}, make("p", { class: "note" }, `Copying ${step.busy.file.name} …`), step.busy.bar),
    make("div", { class: "row" }, make("label", { class: "pick" }, many ? "Choose files" : "Choose a file", input),
      step.busy?.place === place && button("Stop", () => step.busy.request.abort(), { class: "quiet" })));
  element.addEventListener("dragover", (event) => {
    event.preventDefault();
    element.classList.add("over");
  });
  element.addEventListener("dragleave", () => element.classList.remove("over"));
  element.addEventListener("drop", (event) => {
    event.preventDefault();
    element.classList.remove("over");
    add(step, place, event.dataTransfer.files);
  });
  return element;
}

async function remove(step, file) {
  if (!confirm(`Remove ${file.name} from the folder?`)) return;
  if (await step.studio.send("api/remove", { project: step.project, name: file.name })) await renew(step);
}

function add(step, place, files) {
  if (!step.busy) step.refused = [];
  step.queue.push(...[...files].map((file) => ({ place, file })));
  if (!step.busy) sendAll(step);
}

// One file after the other, so that each takes the whole line.
async function sendAll(step) {
  while (step.queue.length) {
    const { place, file } = step.queue.shift();
    step.busy = { place, file, bar: make("progress", { max: 1, value: 0, "aria-label": `Copying ${file.name}` }), request: new XMLHttpRequest() };
    draw(step);
    try {
      await postJson("api/accepts", { project: step.project, place, name: file.name, bytes: file.size });
      await send(step.busy, step.project);
    } catch (error) {
      step.refused.push(error.message);
    }
    step.busy = null;
    await renew(step).catch((error) => step.studio.notice(error.message));
  }
}

// Sends a file as it is; fetch does not tell how much of it has been sent.
function send({ place, file, bar, request }, project) {
  return new Promise((done, failed) => {
    const query = new URLSearchParams({ project, place, name: file.name });
    request.open("POST", `upload?${query}`);
    request.setRequestHeader("Content-Type", "application/octet-stream");
    request.upload.addEventListener("progress", (event) => (bar.value = event.loaded / (event.total || 1)));
    request.addEventListener("load", () => {
      if (request.status === 200) return done();
      let line = request.responseText.trim();
      try {
        line = JSON.parse(line).error;
      } catch {
        // a line of the gate
      }
      return failed(new Error(line || `${file.name} was not taken`));
    });
    request.addEventListener("error", () => failed(new Error(`${file.name} was not copied: the program cannot be reached`)));
    request.addEventListener("abort", () => failed(new Error(`${file.name} was stopped; nothing of it is kept`)));
    request.send(file);
  });
}
