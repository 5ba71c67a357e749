// Files on their way into projects, one after the other, so that each takes the whole line.

import { postJson } from "./api.js";
import { by, button, make, notice, refusal, visible } from "./elements.js";
import { addressOf } from "./rail.js";
import { askToReplace } from "./replace_question.js";

export const VIDEOS = ".mp4,.avi,.mov,.mkv,.m4v,.webm,.mpg,.mpeg,.wmv,.mts,.m2ts,.ts,.3gp,.ogv";
export const STILLS = ".png,.jpg,.jpeg,.bmp,.tif,.tiff,.pbm,.pgm,.ppm,.webp";
const LOOK_AGAIN_MS = 2000;
const MOST_LINES = 6;

// A file's name without its folders and its suffix.
export const stemOf = (file) => file.name.split("/").at(-1).replace(/\.[^.]*$/, "");

export const megabytes = (bytes) => (bytes === null ? "" : bytes < 1e5 ? `${Math.ceil(bytes / 1e3)} kB` : `${(bytes / 1e6).toFixed(1)} MB`);

export const isOf = (name, suffixes) => suffixes.split(",").includes(name.slice(name.lastIndexOf(".")).toLowerCase());

export class Uploads {
  constructor(studio) {
    Object.assign(this, { studio, queue: [], busy: null, refused: [], sent: 0, seen: 0 });
    addEventListener("beforeunload", (event) => this.waiting && event.preventDefault()); // the browser asks
  }

  get waiting() {
    return Boolean(this.busy || this.queue.length);
  }

  // Takes files, each a `path` and a `file`, into a project, or each recording among them into a new
  // one; `chosen` is the place that they were chosen for, pictures without a folder are a `camera`'s.
  async take(files, project, chosen = "", camera = "") {
    const seen = files.filter(({ path }) => !path.split("/").some((part) => part.startsWith(".")));
    if (!seen.length) return notice("that folder holds no files: choose another");
    try {
      const plan = await postJson("api/plan", { project: project ?? "", chosen, camera, files: seen.map(({ path, file }) => [path, file.size, file.lastModified / 1000]) });
      if (!this.waiting) Object.assign(this, { refused: [], sent: 0 });
      this.refused.push(...plan.refused);
      for (const take of plan.takes) await this.begin(take, seen);
      const [first, ...others] = plan.takes;
      if (first && (first.project !== project || !this.studio.watchers.renew)) location.hash = addressOf(others.length ? "projects" : "import", "", first.project);
      notice("");
    } catch (error) {
      notice(error.message);
    }
    this.draw();
    this.sending ??= this.sendAll().finally(() => (this.sending = null));
  }

  // Puts the files of a recording into the queue; those that replace others only if that is wanted.
  async begin({ project, files, conflicts, new: isNew }, chosen) {
    const answer = conflicts.length ? await askToReplace(project, conflicts, chosen) : "keep";
    if (answer && isNew) await postJson("api/new", { name: project });
    for (const [number, path, replaces] of answer ? files : []) {
      if (!replaces || answer === "replace") this.queue.push({ project, path, file: chosen[number].file, replace: replaces ? "1" : "" });
    }
  }

  async sendAll() {
    while (this.queue.length) {
      const item = this.queue.shift();
      this.busy = { ...item, request: new XMLHttpRequest() };
      this.sent += 1;
      if (this.sent === 1 || item.file.size > 1e6) this.draw();
      await this.send(this.busy).catch((error) => this.refused.push(error.message));
      this.busy = null;
      if (this.queue.length && Date.now() - this.seen < LOOK_AGAIN_MS) continue;
      this.seen = Date.now();
      this.draw();
      await this.studio.watchers.renew?.().catch((error) => notice(error.message));
    }
  }

  // What is going on, on every step.
  draw() {
    const { busy, refused } = this;
    const more = refused.length - MOST_LINES;
    by("uploads").hidden = !busy && !refused.length;
    this.bar = make("progress", { max: 1, value: 0, hidden: !busy, "aria-label": "Copying" });
    by("uploads").replaceChildren(
      make("div", { class: "row" }, make("p", { class: "note grow" }, busy ? `Copying ${this.sent} of ${this.sent + this.queue.length} into ${busy.project}: ${busy.path}` : ""),
        button(busy ? "Stop" : "Close", () => (busy ? this.stop() : (by("uploads").hidden = true)), { class: "quiet small" })),
      this.bar, ...refused.slice(0, MOST_LINES).map(refusal),
      ...(more > 0 ? [make("p", { class: "note" }, `and ${more} more that have no place in a recording`)] : []));
    this.studio.watchers.draw?.();
  }

  stop() {
    this.queue = [];
    this.busy?.request.abort();
  }

  // Sends a file as it is; fetch does not tell how much of it has been sent.
  send({ project, path, file, replace, request }) {
    return new Promise((done, failed) => {
      const query = new URLSearchParams({ project, path, replace });
      request.open("POST", `upload?${query}`);
      request.setRequestHeader("Content-Type", "application/octet-stream");
      request.upload.addEventListener("progress", (event) => this.bar && (this.bar.value = event.loaded / (event.total || 1)));
      request.addEventListener("load", () => {
        if (request.status === 200) return done();
        const text = request.responseText.trim(); // the gate's own lines are no JSON
        return failed(new Error((text.startsWith("{") ? JSON.parse(text).error : text) || `${file.name} was not taken`));
      });
      request.addEventListener("error", () => failed(new Error(`${file.name} was not copied: the program cannot be reached`)));
      request.addEventListener("abort", () => failed(new Error(`${file.name} was stopped; nothing of it is kept`)));
      request.send(file);
    });
  }
}

// A button that opens the browser's choice of files, or of a folder.
export function picker(text, take, more = {}) {
  const input = make("input", { type: "file", "aria-label": text, ...more });
  input.addEventListener("change", () => {
    take([...input.files].map((file) => ({ path: file.webkitRelativePath || file.name, file })));
    input.value = "";
  });
  return make("label", { class: "pick" }, text, input);
}

// Lets files and folders be dropped onto an element.
export function dropTarget(element, take) {
  for (const kind of ["dragover", "dragleave", "drop"]) element.addEventListener(kind, (event) => {
    element.classList.toggle("over", kind === "dragover");
    if (kind === "dragleave" || !event.dataTransfer.types.includes("Files")) return;
    event.preventDefault();
    event.stopPropagation();
    const entries = kind === "drop" ? [...event.dataTransfer.items].map((item) => item.webkitGetAsEntry()).filter(Boolean) : [];
    if (entries.length) Promise.all(entries.map(filesOf)).then((files) => take(files.flat()), () => notice("what was dropped cannot be read: choose it by its button"));
  });
  return element;
}

// Files of what was dropped, with their paths; the browser lists a folder piece by piece.
async function filesOf(entry) {
  if (entry.isFile) return [{ path: entry.fullPath.slice(1), file: await new Promise((done, failed) => entry.file(done, failed)) }];
  const reader = entry.createReader();
  const inside = [];
  for (let piece = [entry]; piece.length; inside.push(...piece)) piece = await new Promise((done, failed) => reader.readEntries(done, failed));
  return (await Promise.all(inside.map(filesOf))).flat();
}

// Files of a place, each with a button that removes it.
export function fileList(step, files, named = (file) => file.name.split("/").at(-1)) {
  const remove = async (file) => {
    const what = file.pictures === null ? file.name : `the ${file.pictures} pictures of ${file.name}`;
    if (!confirm(visible(`Remove ${what} from the folder?`))) return;
    if (await step.studio.send("api/remove", { project: step.project, name: file.name })) await step.renew();
  };
  return files.length > 0 && make("ul", {}, ...files.map((file) => make("li", {},
    make("span", { title: file.name }, named(file)),
    make("small", {}, file.pictures === null ? megabytes(file.bytes) : `${file.pictures} pictures, ${megabytes(file.bytes)}`),
    file.bytes !== null && button("Remove", () => remove(file), { class: "quiet small", "aria-label": `Remove ${file.name}` }))));
}
