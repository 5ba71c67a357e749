// The side panel's parts on regions, unknown places and points.

import { button, checkbox, make, rounded, table, tableRow } from "./elements.js";
import { polygonsOf } from "./drawing_pointer.js";

const SAID = {
  region: [
    "Where the person may be. Everything outside is ignored: a second person, a screen, a window.",
    "Without a region, the person may be anywhere in the picture.",
  ],
  unknown: [
    "Where furniture or somebody else stands before the person, so that nothing is known there. Draw generously.",
    "Nothing is hidden in this camera.",
  ],
};

export function placesPanel(app, kind) {
  const camera = app.large;
  const body = [make("p", {}, SAID[kind][0])];
  if (!camera) return [...body, summary(app, kind), pick(app)];
  const polygons = polygonsOf(app.store.doc, kind, camera);
  const list = make("ul", { class: "things" });
  polygons.forEach((polygon, index) => {
    const chosen = app.chosen?.kind === kind && app.chosen.index === index;
    list.append(make("li", { class: chosen ? "chosen" : "" },
      button(`Polygon ${index + 1}`, () => app.set({ chosen: { kind, index } }), { class: "link" }),
      make("small", {}, `${polygon.length} corners`),
      button("Delete", () => app.removePolygon(kind, camera, index), { class: "small" })));
  });
  body.push(make("p", {}, make("b", {}, camera)), list);
  const painted = paintedNote(app, kind, camera);
  if (painted) body.push(painted);
  else if (!polygons.length) body.push(make("p", { class: "note" }, SAID[kind][1]));
  body.push(make("p", { class: "note" },
    "Click corners in the picture; click the first one again, or press ", make("kbd", {}, "Enter"),
    ", to close. Drag corners to move them, the small dots between them for new ones; ",
    make("kbd", {}, "Del"), " removes what is chosen. A click within a polygon chooses it; with ",
    make("kbd", {}, "Shift"), ", one begins inside another."));
  return body;
}

function paintedNote(app, kind, camera) {
  const { painted_region, painted_unknown } = app.cameraState(camera);
  if (kind === "unknown" && painted_unknown) {
    return make("p", { class: "note" },
      `unknown/${camera} is painted: it is shown and kept, polygons add to it.`);
  }
  if (kind === "region" && painted_region) {
    const { painted } = app.store.doc.regions[camera];
    return checkbox("Keep the painted region of the file; polygons add to it", painted, (now) =>
      app.store.change(`painted ${camera}`, (doc) => (doc.regions[camera].painted = now)));
  }
  return null;
}

function summary(app, kind) {
  const list = make("ul", { class: "things" });
  for (const { name, ...camera } of app.store.state.cameras) {
    const count = polygonsOf(app.store.doc, kind, name).length;
    const painted = kind === "region"
      ? camera.painted_region && app.store.doc.regions[name].painted : camera.painted_unknown;
    const words = [count && `${count} polygon${count > 1 ? "s" : ""}`, painted && "painted"];
    list.append(make("li", {},
      button(name, () => app.enlarge(name), { class: "link" }),
      make("small", {}, words.filter(Boolean).join(", ") || "–")));
  }
  return list;
}

const pick = (app) => make("p", { class: "note" },
  app.views.size > 1 ? "Click a camera to draw in its picture." : "Click the picture to draw in it.");

export function pointsPanel(app) {
  const { doc, state } = app.store;
  const body = [make("p", {},
    "Corners of tiles, tape marks, posts: places that several cameras see and of which you know where"
    + " they are. Calibrate, part 3, finds the cameras from four or more.")];
  body.push(make("div", { class: "row" },
    button("New point", () => app.addPoint(), { class: "main", id: "new_point" })));
  const list = make("ul", { class: "things" });
  for (const point of doc.points) {
    const clicks = Object.keys(point.pixels).length;
    const errors = Object.values(app.errors[point.name]?.pixels || {}).map((each) => each.error_px);
    const worst = Math.max(...errors.filter(Number.isFinite));
    list.append(make("li", { class: point.name === app.point ? "chosen" : "" },
      button(point.name, () => app.choosePoint(point.name), { class: "link" }),
      make("small", { class: worst > 3 ? "bad" : "" },
        `${clicks ? `${clicks} ×` : "no click"}${worst >= 0 ? ` · ${rounded(worst, 1)} px` : ""}`)));
  }
  body.push(list);
  const point = doc.points.find((each) => each.name === app.point);
  if (point) body.push(...pointForm(app, point));
  if (state.refused.points) {
    body.push(make("p", { class: "note" }, "Errors in pixels are shown once there is a calibration: "
      + state.refused.points));
  }
  return body;
}

function pointForm(app, point) {
  const edit = (label, change) => app.store.change(label, (doc) =>
    change(doc.points.find((each) => each.name === point.name)));
  const name = make("input", {
    type: "text", id: "point_name", value: point.name, maxLength: 60, "aria-label": "Name of the point",
    onchange: () => app.renamePoint(point.name, name.value),
  });
  const axes = ["x", "y", "z"].map((axis, index) => make("input", {
    type: "text", inputMode: "decimal", id: `point_${axis}`,
    value: point.position_m?.[index] ?? app.typed[point.name]?.[index] ?? "",
  }));
  for (const input of axes) input.addEventListener("change", () => typed(app, point, axes, edit));
  const body = [
    make("div", { class: "row" }, name, button("Delete", () => app.removePoint(point.name))),
    make("div", { class: "xyz" }, ...axes.map((input, index) =>
      make("label", {}, `${"xyz"[index]}, m`, input))),
    pixelTable(app, point),
    make("p", { class: "note" },
      "Enlarge a camera and click; ", make("kbd", {}, "←"), " ", make("kbd", {}, "→"), " ",
      make("kbd", {}, "↑"), " ", make("kbd", {}, "↓"), " move by 0.1 px, with ",
      make("kbd", {}, "Shift"), " by 1 px. Without world coordinates a point still connects the"
      + " cameras that see it."),
  ];
  return body;
}

// Three numbers make a position; none of them removes it; in between nothing is saved.
function typed(app, point, axes, edit) {
  const texts = axes.map((input) => input.value.trim().replace(",", "."));
  const values = texts.map((text) => (text === "" ? NaN : Number(text)));
  const good = values.map((value) => Number.isFinite(value) && Math.abs(value) <= 10_000);
  axes.forEach((input, index) => input.classList.toggle("wrong", texts[index] !== "" && !good[index]));
  app.typed[point.name] = axes.map((input) => input.value);
  if (good.every(Boolean)) edit(`position ${point.name}`, (each) => (each.position_m = values));
  else if (texts.every((text) => text === "")) edit(`position ${point.name}`, (each) => (each.position_m = null));
}

function pixelTable(app, point) {
  const rows = app.store.state.cameras.map(({ name }) => {
    const pixel = point.pixels[name];
    const error = app.errors[point.name]?.pixels[name]?.error_px;
    return tableRow([
      make("td", {}, button(name, () => app.enlarge(name), { class: "link" })), pixel ? `${rounded(pixel[0], 1)}, ${rounded(pixel[1], 1)}` : "–",
      make("td", { class: error > 3 ? "bad" : "" }, error === undefined ? "" : `${rounded(error, 2)} px`),
    ]);
  });
  return table(["camera", "click, px", "off by"], rows);
}
