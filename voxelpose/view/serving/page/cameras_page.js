// A page of cameras: their pictures, one of which may be enlarged, and moments to go through.

import { getJson, loadImage, onConnection } from "./api.js";
import { CameraView } from "./camera_view.js";
import { by, notice } from "./elements.js";
import { latest } from "./stages.js";

export class CamerasPage {
  // The state names cameras and moments; subclasses have `pathOf(view)`, `scene(name)`, and `loadMoment()`.
  constructor(state, name, Pointer, lost) {
    this.views = new Map();
    this.large = null;
    this.moment = Math.floor(state.moments / 2);
    this.moments = state.moments;
    this.pointer = new Pointer(this);
    this.loadPictures = latest(60, (current) => this.pictures(current), (error) => this.timeText(error.message));
    document.querySelector("h1 span").textContent = name;
    document.title = `${state.name} – voxelpose ${name}`;
    Object.assign(by("recording"), { textContent: state.name, title: state.folder });
    for (const camera of state.cameras) {
      const view = new CameraView(camera);
      view.scene = (camera_name) => this.scene(camera_name);
      view.element.addEventListener("whole", () => view.reset());
      view.element.addEventListener("all", () => this.enlarge(null));
      this.pointer.attach(view);
      this.views.set(camera.name, view);
      by("tiles").append(view.element);
    }
    Object.assign(by("moment"), { max: state.moments - 1, value: this.moment });
    by("moment").addEventListener("input", () => this.seek(+by("moment").value));
    by("back").addEventListener("click", () => this.seek(this.moment - 1));
    by("forward").addEventListener("click", () => this.seek(this.moment + 1));
    addEventListener("resize", () => this.arrange());
    onConnection((reachable) => notice(reachable ? "" : `The program has ended or cannot be reached${lost}`));
  }

  timeText(text) {
    by("moment_text").textContent = text;
  }

  seek(moment) {
    this.moment = Math.min(Math.max(moment, 0), this.moments - 1);
    by("moment").value = this.moment;
    by("loading").hidden = false;
    this.loadPictures();
    this.loadMoment();
  }

  async pictures(current) {
    try {
      await Promise.all([...this.views.values()].map(async (view) => {
        const path = this.pathOf(view);
        const image = path && await loadImage(path);
        if (!current()) return;
        view.image = image;
        view.draw();
      }));
    } finally {
      if (current()) by("loading").hidden = true;
    }
  }

  // Places of the pictures: as large as fits, or one large above the others.
  arrange() {
    const { views, large } = this;
    const { style } = by("tiles");
    const count = views.size;
    const { width, height } = by("tiles").getBoundingClientRect();
    const [first] = views.values();
    const aspect = first.width / first.height;
    for (const view of views.values()) {
      view.large = view.name === large;
      view.element.classList.toggle("large", view.large);
      view.element.style.gridArea = view.large ? `1 / 1 / 2 / ${Math.max(count, 2)}` : "";
      view.element.style.order = view.large ? -1 : 0;
      view.draw();
    }
    if (large) {
      style.gridTemplateColumns = `repeat(${Math.max(count - 1, 1)}, minmax(0, 1fr))`;
      style.gridTemplateRows = count > 1 ? "minmax(0, 1fr) clamp(64px, 17%, 130px)" : "minmax(0, 1fr)";
      return;
    }
    let best = { side: 0, columns: 1 };
    for (let columns = 1; columns <= count; columns++) {
      const side = Math.min(width / columns, (height / Math.ceil(count / columns)) * aspect);
      if (side > best.side + 1) best = { side, columns };
    }
    style.gridTemplateColumns = `repeat(${best.columns}, minmax(0, 1fr))`;
    style.gridTemplateRows = `repeat(${Math.ceil(count / best.columns)}, minmax(0, 1fr))`;
  }
}

// Opens a page of a class with what the program knows.
export async function openPage(Page) {
  try {
    window.app = new Page(await getJson("api/state"));
  } catch (error) {
    notice(error.message);
  }
}
