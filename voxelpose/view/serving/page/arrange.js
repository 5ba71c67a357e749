// The pictures of a page's cameras, which may be enlarged, and the elements that go through moments.
import { CameraView } from "./camera_view.js";

const by = (id) => document.getElementById(id);

export function addCameras(app, cameras, scene) {
  for (const camera of cameras) {
    const view = new CameraView(camera);
    view.scene = scene;
    view.element.addEventListener("whole", () => view.reset());
    view.element.addEventListener("all", () => app.enlarge(null));
    app.pointer.attach(view);
    app.views.set(camera.name, view);
    by("tiles").append(view.element);
  }
}

export function addMoments(app, moments) {
  Object.assign(by("moment"), { max: moments - 1, value: app.moment });
  by("moment").addEventListener("input", () => app.seek(+by("moment").value));
  by("back").addEventListener("click", () => app.seek(app.moment - 1));
  by("forward").addEventListener("click", () => app.seek(app.moment + 1));
}

// Places of the pictures: as large as fits, or one large above the others.
export function arrange(tiles, views, large) {
  const count = views.size;
  const { width, height } = tiles.getBoundingClientRect();
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
    tiles.style.gridTemplateColumns = `repeat(${Math.max(count - 1, 1)}, minmax(0, 1fr))`;
    tiles.style.gridTemplateRows = count > 1 ? "minmax(0, 1fr) clamp(64px, 17%, 130px)" : "minmax(0, 1fr)";
    return;
  }
  let best = { side: 0, columns: 1 };
  for (let columns = 1; columns <= count; columns++) {
    const side = Math.min(width / columns, (height / Math.ceil(count / columns)) * aspect);
    if (side > best.side + 1) best = { side, columns };
  }
  tiles.style.gridTemplateColumns = `repeat(${best.columns}, minmax(0, 1fr))`;
  tiles.style.gridTemplateRows = `repeat(${Math.ceil(count / best.columns)}, minmax(0, 1fr))`;
}
