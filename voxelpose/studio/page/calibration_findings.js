// What calibrations found: each camera's coverage and lens, the rig, and clocks.

import { make, rounded, table, tableRow } from "./elements.js";
import { fileList, stemOf } from "./uploads.js";

const signed = (value, digits) => `${value > 0 ? "+" : ""}${value.toFixed(digits)}`;

// A card for each camera: its pictures, where the board was seen, and how good the lens is.
export function lensCards(step, files) {
  const found = step.known.lenses ?? {};
  const names = files.map(stemOf);
  const cards = files.map((file, index) => card(step, names[index], file, found[names[index]]));
  const others = Object.keys(found).filter((name) => !names.includes(name)).map((name) => card(step, name, null, found[name]));
  return cards.length + others.length ? [make("div", { class: "cards lenses" }, ...cards, ...others)] : [];
}

function card(step, name, file, lens) {
  const stage = make("div", { class: "coverage" });
  if (file) {
    const query = new URLSearchParams({ project: step.project, name: file.name });
    stage.append(make("img", { src: `still?${query}`, alt: `The board before ${name}`, loading: "lazy" }));
  }
  if (lens) stage.append(coverage(lens));
  return make("section", { class: "card", "data-camera": name },
    make("h3", {}, name), stage, ...(lens ? lensWords(lens) : [make("p", { class: "note" }, "not calibrated yet")]),
    file && fileList(step, [file], (one) => (one.pictures === null ? one.name.split("/").at(-1) : "")));
}

// Cells of the picture in which corners were seen, over a picture: red where there were none.
export function coverage({ corners_per_cell: cells, size }) {
  const [width, height] = size;
  const canvas = make("canvas", { width: 400, height: Math.round((400 * height) / width), role: "img", "aria-label": `The board was seen in ${cells.flat().filter(Boolean).length} of ${cells.flat().length} cells of the picture` });
  const pen = canvas.getContext("2d");
  const most = Math.max(...cells.flat(), 1);
  cells.forEach((line, y) => line.forEach((count, x) => {
    pen.fillStyle = count ? `rgb(80 200 120 / ${20 + Math.round((45 * count) / most)}%)` : "rgb(255 80 70 / 45%)";
    pen.fillRect((x * canvas.width) / line.length + 1, (y * canvas.height) / cells.length + 1, canvas.width / line.length - 2, canvas.height / cells.length - 2);
  }));
  return canvas;
}

function lensWords(lens) {
  const used = lens.pictures.filter((picture) => picture.left_out === null);
  const left = lens.pictures.filter((picture) => picture.left_out !== null);
  const before = Number.isFinite(lens.before_rms_px) ? `; before ${rounded(lens.before_rms_px, 2)} px` : "";
  return [
    make("p", { class: lens.rms_px < 0.5 ? "good" : lens.rms_px < 1 ? "" : "bad" }, make("b", {}, `${rounded(lens.rms_px, 2)} px`), ` error in ${used.length} of ${lens.pictures.length} pictures${before}`),
    make("p", { class: "note" }, `focal length ${rounded(lens.matrix[0][0], 0)} ± ${rounded(lens.focal_standard_error_px[0], 1)} px`),
    ...lens.advice.map((text) => make("p", { class: "note warn" }, text)),
    left.length > 0 && make("details", { class: "plain" }, make("summary", {}, `${left.length} left out`),
      make("ul", { class: "plain" }, ...left.map((picture) => make("li", {}, `${picture.picture}: ${picture.left_out}`)))),
  ].filter(Boolean);
}

// The table of a rig's cameras, and its picture.
export function rigFindings({ known, project }) {
  const { rig } = known;
  if (!rig) return known.calibration ? [make("p", { class: "note" }, `${known.calibration} is there, of another program or an earlier time.`)] : [];
  const lines = Object.entries(rig.cameras);
  const before = lines.some(([, line]) => Number.isFinite(line.before_rms_px));
  const rows = lines.map(([name, line]) => tableRow([name, String(line.seen), ...(before ? [rounded(line.before_rms_px, 2)] : []), rounded(line.rms_px, 2),
    Number.isFinite(line.position_standard_error_mm) ? `± ${rounded(line.position_standard_error_mm, 1)}` : "reference",
    Number.isFinite(line.rotation_standard_error_deg) ? `± ${rounded(line.rotation_standard_error_deg, 2)}` : "", line.center_m.map((value) => rounded(value, 2).replace(/^-(0\.0+)$/, "$1")).join(", ")]));
  const pairs = rig.shared.map(({ cameras, count }) => `${cameras.join("–")} ${count}`).join(", ");
  return [make("div", { class: "found", id: "rig_found" },
    make("h4", {}, `Found: ${lines.length} cameras, ${rounded(rig.rms_px, 2)} px`),
    make("div", { class: "wide" }, table(["camera", "seen", ...(before ? ["before, px", "now, px"] : ["error, px"]), "position, mm", "turn, °", "where, m"], rows)),
    make("p", { class: "note" }, `Shared by pairs: ${pairs}. Good is below 1 px, and a few millimetres.`),
    ...rig.advice.map((text) => make("p", { class: "note warn" }, text)),
    known.rig_picture && make("img", { class: "shot", src: `rig?${new URLSearchParams({ project, made: known.rig_picture })}`, alt: "The cameras from above and from the side: does it look like the room?" }))];
}

export function offsetTable(job) {
  const rows = job.offsets.map((line) => tableRow([line.camera, rounded(line.fps, 2), ...(line.reference ? ["its clock counts", "", ""]
    : [signed(line.late_frames, 2), signed(line.late_ms, 1), line.error_ms === null ? "?" : `± ${(2 * line.error_ms).toFixed(1)}`])]));
  return make("div", { class: "wide" }, table(["camera", "frames a second", "late by, frames", "ms", "ms, 95 %"], rows, { id: "offsets" }));
}
