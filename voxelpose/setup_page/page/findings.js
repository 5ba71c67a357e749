// The side panel's parts on silhouettes and settings, the check of the cameras, up and the floor.

import { button, checkbox, make, refusal, rounded, table, tableRow } from "./elements.js";
import { STAGES, stageButtons, stageNames } from "./stages.js";

const USUAL = { background: "auto", tolerance: "0", voxel: "automatic", repair: "auto",
  stature: "estimated" };

export function silhouettesPanel(app) {
  const { state } = app.store;
  const names = state.masks_only ? ["picture", "silhouette"] : stageNames({ paper: app.overlays.method === "paper" });
  const body = [
    make("p", {}, "Silhouettes of the shown frame, as they are made with what is drawn and chosen"
      + " here. A result is as good as its silhouettes: whole, without shadows, nothing beside the person."),
    stageButtons(names, app.stage, (stage) => app.set({ stage })),
    make("p", {}, STAGES[app.stage][1]),
  ];
  if (app.stage !== "picture") body.push(make("p", { class: "note", id: "silhouette_state" }, app.silhouetteNote));
  body.push(make("p", {}, make("b", {}, "Settings of Estimate")), settingsGrid(app, state));
  body.push(make("p", { class: "note" }, "Kept in voxelpose.toml of this folder."));
  return body;
}

function settingsGrid(app, state) {
  const grid = make("div", { class: "grid" });
  const row = (name, text, input) => {
    input.id = `fit_${name}`;
    grid.append(make("label", { htmlFor: input.id }, text), input);
    const note = name === "background" && state.refused.background ? state.refused.background : inherited(state, name);
    if (note) grid.append(make("div", { class: "note" }, note));
  };
  row("background", "Background", select(app, "background", ["auto", "uniform", "moving", "paper"], Boolean(state.refused.background)));
  row("tolerance", "Tolerance, cameras", numeric(app, "tolerance", { ...state.ranges.tolerance, step: 1 }, true));
  row("repair", "Repair cameras", select(app, "repair", ["auto", "say", "off"], false));
  row("voxel", "Voxel, m", numeric(app, "voxel", { ...state.ranges.voxel, step: "any" }, false));
  row("stature", "Stature, m", numeric(app, "stature", { ...state.ranges.stature, step: "any" }, false));
  if (state.cameras.length > 1) {
    const chosen = app.store.doc.fit.cameras;
    const boxes = state.cameras.map(({ name }) => checkbox(name, !chosen || chosen.includes(name), (now) =>
      app.useCamera(name, now)));
    grid.append(make("label", {}, "Cameras"), make("div", { class: "boxes" }, ...boxes));
    const note = inherited(state, "cameras");
    if (note) grid.append(make("div", { class: "note" }, note));
  }
  return grid;
}

// What a folder above says, where this one says nothing.
function inherited(state, name) {
  const setting = state.settings[name];
  return setting && setting.file !== state.own_settings ? `${setting.value}, from ${setting.file}` : "";
}

function select(app, name, choices, disabled) {
  const value = app.store.doc.fit[name];
  const usual = inherited(app.store.state, name) ? "as in the other file" : `usual (${USUAL[name]})`;
  const element = make("select", { disabled },
    make("option", { value: "" }, usual), ...choices.map((each) => make("option", { value: each }, each)));
  element.value = value ?? "";
  element.addEventListener("change", () => app.setFit(name, element.value || null));
  return element;
}

function numeric(app, name, bounds, whole) {
  const value = app.store.doc.fit[name];
  const input = make("input", { type: "number", value: value ?? "", placeholder: USUAL[name], ...bounds });
  input.addEventListener("change", () => {
    const good = input.value === "" ? input.validity.valid : input.validity.valid && (!whole || Number.isInteger(+input.value));
    input.classList.toggle("wrong", !good);
    if (good) app.setFit(name, input.value === "" ? null : Number(input.value));
  });
  return input;
}

export function checkPanel(app) {
  const { state } = app.store;
  const body = [make("p", {}, "Whether the calibration still fits these videos, by the silhouettes of a"
    + " dozen moments: `voxelpose calibrate check`.")];
  if (state.refused.check) body.push(refusal(state.refused.check));
  const { check } = app;
  const running = check.state === "running";
  const label = running ? "Checking …" : check.state === "idle" ? "Check the cameras" : "Check again";
  body.push(make("div", { class: "row" },
    button(label, () => app.ask("api/check/start"), { class: "main", id: "start_check", disabled: running || Boolean(state.refused.check) })));
  if (app.store.dirtyParts.some((part) => part !== "points") && !state.refused.check) {
    body.push(make("p", { class: "note" }, "It reads the folder: save first what is to count."));
  }
  if (check.state === "failed") body.push(refusal(check.error));
  if (check.state === "done") body.push(...findings(app, check));
  return body;
}

function findings(app, check) {
  const rows = check.cameras.map((line) => tableRow([
    line.camera, rounded(line.error_px, 1), rounded(line.others_px, 1), String(line.planes),
    make("td", { class: line.verdict === "agrees" ? "good" : "bad" }, line.verdict)]));
  const body = [
    make("p", { class: check.agrees ? "good" : "bad", id: "check_summary" }, check.summary),
    table(["camera", "off, px", "others, px", "planes", ""], rows),
  ];
  body.push(...check.findings.map(({ about, words, remedy }) => make("p", { class: about === "note" ? "note" : "" },
    ...(remedy ? [make("b", {}, words), make("br"), remedy] : [words]))));
  const files = Object.keys(check.repaired);
  if (files.length) {
    body.push(
      button("Repair", () => app.repair(), { class: "main", id: "repair", disabled: app.store.dirty }),
      make("p", { class: "note" }, `Writes ${files.join(" and ")}; what they replace is kept in before_repair/.`
        + (app.store.dirty ? " Save what is drawn first." : "")));
  }
  body.push(make("img", { class: "shot", src: `data:image/png;base64,${check.picture}`, alt: "Every camera with the outlines that the others predict", onclick: (event) => app.enlargePicture(event.target.src) }));
  return body;
}

export function floorPanel(app) {
  const { state, doc } = app.store;
  const body = [make("p", {}, "The grid must lie on the floor and the yellow pole, 1.8 m, must stand"
    + " upright on it. Red, green and blue are the axes x, y and z of the calibration's world.")];
  if (state.refused.floor) return [...body, refusal(state.refused.floor)];
  const { found, source, choices } = state.up;
  const other = inherited(state, "up");
  body.push(checkbox("Show floor and axes", app.ground, (now) => app.set({ ground: now }), { id: "show_ground" }));
  const options = [{ name: "", text: other ? `as in the other file (${other})` : `as found: ${found}` },
    ...choices.map(({ name, worth }) => ({ name, text: `${name}  ·  cameras ${Math.round(100 * worth)} %` }))];
  const own = doc.fit.up;
  if (own !== null && !options.some(({ name }) => name === own)) options.push({ name: own, text: own });
  const element = make("select", { id: "up" }, ...options.map(({ name, text }) => make("option", { value: name }, text)));
  element.value = own ?? "";
  element.addEventListener("change", () => app.setFit("up", element.value || null));
  const free = make("input", { type: "text", id: "up_numbers", placeholder: "or three numbers: 0,0.1,-1" });
  free.addEventListener("change", () => {
    const good = free.value.split(",").length === 3 && free.value.split(",").every((text) => text.trim() && Number.isFinite(+text));
    free.classList.toggle("wrong", !good);
    if (good) app.setFit("up", free.value.replaceAll(" ", ""));
  });
  body.push(make("div", { class: "grid" }, make("label", { htmlFor: "up" }, "Up is"), element,
    make("span"), free));
  body.push(make("p", { class: "note" }, `${found} is found from ${source}. The share tells how well a direction explains how the`
    + " cameras stand. What is chosen is kept in voxelpose.toml; the calibration is not changed."));
  const height = make("input", { type: "range", min: -2, max: 2, step: 0.01, value: app.height, id: "height" });
  const text = make("output", {}, `${rounded(app.height, 2)} m`);
  height.addEventListener("input", () => {
    text.textContent = `${rounded(+height.value, 2)} m`;
    app.set({ height: +height.value });
  });
  body.push(make("div", { class: "row" }, make("label", { htmlFor: "height" }, "Height"), height, text));
  body.push(make("p", { class: "note" }, "Height of the grid in the calibration's world, to look at only: the program"
    + " finds the floor from the feet."));
  return body;
}
