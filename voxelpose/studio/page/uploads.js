// Files on their way into a project, one after the other, so that each takes the whole line.

import { postJson } from "./api.js";
import { button, make, notice } from "./elements.js";

export const VIDEOS = ".mp4,.avi,.mov,.mkv,.m4v,.webm,.mpg,.mpeg,.wmv,.mts,.m2ts,.ts,.3gp,.ogv";
export const STILLS = ".png,.jpg,.jpeg,.bmp,.tif,.tiff,.pbm,.pgm,.ppm,.webp";
const LOOK_AGAIN_MS = 2000;
const OWN_FOLDERS = ["background", "board_walk"]; // whose loose pictures are each a camera's

// A file's name without its folders and its suffix.
export const stemOf = (file) => file.name.split("/").at(-1).replace(/\.[^.]*$/, "");

export const megabytes = (bytes) => (bytes === null ? "" : bytes < 1e5 ? `${Math.ceil(bytes / 1e3)} kB` : `${(bytes / 1e6).toFixed(1)} MB`);

const isOf = (name, suffixes) => suffixes.split(",").includes(name.slice(name.lastIndexOf(".")).toLowerCase());

export class Uploads {
  // `draw` shows what is going on, `renew` also what has come.
  constructor(studio, project, draw, renew) {
    Object.assign(this, { studio, project, draw, renew, queue: [], busy: null, refused: [], sent: 0, seen: 0 });
  }

  get waiting() {
    return Boolean(this.busy || this.queue.length);
  }

  // Files as they are; pictures may be those of a `camera`.
  add(place, files, camera = "") {
    this.take([...files].map((file) => ({ place, file, camera: isOf(file.name, STILLS) ? camera : "" })));
  }

  // What a folder holds: videos, and pictures, each in the folder of its camera.
  addFolder(place, files) {
    const items = [...files].filter((file) => !file.name.startsWith(".")).flatMap((file) => {
      const folders = file.webkitRelativePath.split("/").slice(0, -1);
      const loose = folders.length === 1 && OWN_FOLDERS.includes(folders[0]) && OWN_FOLDERS.includes(place);
      if (isOf(file.name, VIDEOS)) return { place, file, camera: "" };
      return isOf(file.name, STILLS) ? { place, file, camera: loose ? "" : folders.at(-1) } : [];
    });
    items.sort((a, b) => (a.camera + a.file.name).localeCompare(b.camera + b.file.name, undefined, { numeric: true }));
    if (items.length) this.take(items);
    else notice("that folder holds no videos and no pictures: choose another");
  }

  take(items) {
    if (!this.waiting) Object.assign(this, { refused: [], sent: 0 });
    this.queue.push(...items);
    if (!this.sending) this.sending = this.sendAll().finally(() => (this.sending = null));
  }

  stop() {
    this.queue = [];
    this.busy?.request.abort();
  }

  async sendAll() {
    while (this.queue.length) {
      const item = this.queue.shift();
      this.busy = { ...item, request: new XMLHttpRequest() };
      this.sent += 1;
      if (this.sent === 1 || item.file.size > 1e6) this.draw();
      try {
        await postJson("api/accepts", { project: this.project, place: item.place, name: item.file.name, camera: item.camera, bytes: item.file.size });
        await this.send(this.busy);
      } catch (error) {
        this.refused.push(error.message);
      }
      this.busy = null;
      if (this.queue.length && Date.now() - this.seen < LOOK_AGAIN_MS) continue;
      this.seen = Date.now();
      await this.renew().catch((error) => notice(error.message));
    }
  }

  // How far the files of a place are.
  progress(place) {
    if (this.busy?.place !== place) return null;
    const count = this.sent + this.queue.length;
    const which = count > 1 ? `${this.sent} of ${count}: ` : "";
    this.bar = make("progress", { max: 1, value: 0, "aria-label": `Copying ${this.busy.file.name}` });
    return make("div", {}, make("p", { class: "note" }, `Copying ${which}${this.busy.file.name} …`), this.bar,
      button("Stop", () => this.stop(), { class: "quiet small" }));
  }

  // Sends a file as it is; fetch does not tell how much of it has been sent.
  send({ place, file, camera, request }) {
    return new Promise((done, failed) => {
      const query = new URLSearchParams({ project: this.project, place, name: file.name, camera });
      request.open("POST", `upload?${query}`);
      request.setRequestHeader("Content-Type", "application/octet-stream");
      request.upload.addEventListener("progress", (event) => this.bar && (this.bar.value = event.loaded / (event.total || 1)));
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
}

// A button that opens the browser's choice of files, or of a folder.
export function picker(text, take, more = {}) {
  const input = make("input", { type: "file", "aria-label": text, ...more });
  input.addEventListener("change", () => take(input.files));
  return make("label", { class: "pick" }, text, input);
}

// Lets files be dropped onto an element.
export function dropTarget(element, take) {
  element.addEventListener("dragover", (event) => {
    event.preventDefault();
    element.classList.add("over");
  });
  element.addEventListener("dragleave", () => element.classList.remove("over"));
  element.addEventListener("drop", (event) => {
    event.preventDefault();
    element.classList.remove("over");
    take(event.dataTransfer.files);
  });
  return element;
}

// Files of a place, each with a button that removes it.
export function fileList(step, files, named = (file) => file.name.split("/").at(-1)) {
  const remove = async (file) => {
    const what = file.pictures === null ? file.name : `the ${file.pictures} pictures of ${file.name}`;
    if (!confirm(`Remove ${what} from the folder?`)) return;
    if (await step.studio.send("api/remove", { project: step.project, name: file.name })) await step.uploads.renew();
  };
  return files.length > 0 && make("ul", {}, ...files.map((file) => make("li", {},
    make("span", { title: file.name }, named(file)),
    make("small", {}, file.pictures === null ? megabytes(file.bytes) : `${file.pictures} pictures, ${megabytes(file.bytes)}`),
    file.bytes !== null && button("Remove", () => remove(file), { class: "quiet small", "aria-label": `Remove ${file.name}` }))));
}
