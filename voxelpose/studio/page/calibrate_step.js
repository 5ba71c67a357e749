// Calibrate: a board to print, its pictures, the lenses, the positions, and what is out of step.

import { getJson, postJson } from "./api.js";
import { lensCards, offsetTable, rigFindings } from "./calibration_findings.js";
import { errorAtField, field, grouped, isWrong, labelled } from "./form_fields.js";
import { allow, outcome } from "./job_panel.js";
import { button, freeName, make, notice } from "./elements.js";
import { addressOf } from "./rail.js";
import { dropTarget, fileList, picker, stemOf, STILLS, VIDEOS } from "./uploads.js";

const OF_BOARD = ["board", "square", "marker", "dictionary"];
// Jobs, each told in the part of the page that begins it.
const PARTS = { "lens calibration": "lenses", "position calibration": "positions", "board synchronisation": "walk_times", synchronisation: "times" };

export async function calibrateStep(studio, state, project) {
  const step = { studio, project, typed: { board: {}, look: {}, intrinsics: {}, extrinsics: {}, boards: {}, take: {} }, panel: make("div", { "aria-live": "polite" }) };
  step.renew = () => renew(step);
  step.known = await getJson(statePath(step));
  const holders = (step.holders = make("div", {}, sheetPart(step), lensPart(step), positionPart(step), timePart(step)));
  drawLook(step);
  drawFiles(step);
  studio.onFiles(() => drawFiles(step), step.renew);
  let before = null;
  studio.watch(Object.keys(PARTS), [project], async (job, busy) => {
    const ended = before === "running" && job.state === "done";
    before = job.state;
    if (ended) await renew(step).catch((error) => notice(error.message));
    const place = holders.querySelector(`[data-job=${PARTS[job.kind]}]`);
    place?.append(step.panel);
    place?.closest("details")?.setAttribute("open", "");
    step.panel.replaceChildren(...outcome(job, project, () => result(job)));
    step.busy = busy;
    allowStarts(step);
  });
  return [
    make("h2", {}, "Calibrate"),
    make("p", { class: "lead" }, "What the cameras' lenses are like and where they stand, from a printed board. The lenses are done once; the positions again whenever a camera has moved. Files of other programs go into Import instead."),
    holders,
    make("div", { class: "row end" }, make("a", { class: "button quiet", id: "next", href: addressOf("check", "./", project) }, "Next: Check")),
  ];
}

const statePath = (step) => `api/calibration?project=${encodeURIComponent(step.project)}`;

async function renew(step) {
  step.known = await getJson(statePath(step));
  drawFiles(step);
}

function result(job) {
  if (job.offsets) return [make("h3", {}, "The time of every frame is found"), offsetTable(job), ...job.verdict.map((line) => make("p", { class: "note" }, line))];
  return [make("p", { class: "good" }, job.kind === "lens calibration" ? "The lenses are calibrated: see each camera above." : "The positions are calibrated: does the picture look like the room?")];
}

const section = (number, title, id, ...parts) => make("section", { class: "job numbered", id }, make("h3", {}, make("i", {}, number), title), ...parts);

const begin = (step, holder, asked) => step.studio.begin("api/calibrate", { project: step.project, ...asked }, holder);

// The settings of a command, but for those of the board; in their own part of the page.
const settings = (step, command, names, typed = command, before = []) => make("div", {}, ...grouped(
  step.known.forms[command].filter((row) => !OF_BOARD.includes(row.name)), (row) => field(row, step.typed[typed], names), before));

// A button that begins a calibration, and where it is told how that goes.
const starter = (text, id, start, place, kind = "main") => [
  make("div", { class: "row end" }, button(text, start, { class: kind, id, "data-calibrate": "" })), make("div", { "data-job": place })];

// 1: the board, and what it looks like.
function sheetPart(step) {
  const holder = make("div");
  const look = (step.look = make("div"));
  const said = make("div", { "aria-live": "polite" });
  step.sheet = make("a", { class: "button quiet", id: "sheet", href: `sheet/board?project=${encodeURIComponent(step.project)}`, download: "" }, "Download board.pdf");
  const produce = async () => {
    if (isWrong(holder)) return;
    try {
      const board = await postJson("api/board", { project: step.project, settings: step.typed.board });
      notice("");
      step.known.sheet = true;
      for (const name of OF_BOARD) step.typed.look[name] = board[name];
      const [across, down] = board.squares.map((count) => Number((1000 * count * board.square).toFixed(1)));
      said.replaceChildren(make("p", { class: "fine", id: "measure" }, `A page of ${board.page_mm.join(" × ")} mm. Print it at 100 % ("actual size"), then measure: ${board.squares[0]} squares in a row are ${across} mm, ${board.squares[1]} in a column ${down} mm. If not, divide what you measure by ${board.squares[0]} and correct \`square\` below.`),
        ...(board.symmetric ? [make("p", { class: "note" }, "This board looks the same after half a turn: take one even and one odd number.")] : []));
      drawLook(step);
      await renew(step);
    } catch (error) {
      if (!errorAtField(holder, error)) notice(error.message);
    }
  };
  holder.append(...grouped(step.known.forms.board, (row) => field(row, step.typed.board, "sheet")));
  return section("1", "Print a board", "board",
    make("p", {}, "Glue it to a flat, stiff plate: a bent board causes errors. A4 is seen up to two metres away; for a room take squares of 8 to 12 cm. You have a board already? Say below what it looks like."),
    holder, make("div", { class: "row wrap" }, button("Make the board", produce, { id: "make_board" }), step.sheet), said,
    make("h4", {}, "What your board looks like"), look);
}

// 2: stills or a video of the board before each camera.
function lensPart(step) {
  const holder = settings(step, "intrinsics", "lens");
  step.boards = make("div");
  const camera = step.camera = make("input", { type: "text", id: "camera_name", class: "grow", "aria-label": "Camera of the pictures", maxLength: 80, oninput: () => (step.named = true) });
  const take = (files) => {
    step.studio.uploads.take(files, step.project, "boards", camera.value.trim());
    step.named = false;
  };
  const add = (files) => step.studio.uploads.take(files, step.project, "boards");
  const card = dropTarget(make("section", { class: "card" },
    make("div", { class: "row wrap" }, make("label", { htmlFor: "camera_name" }, "pictures of camera"), camera,
      picker("Choose pictures", take, { accept: STILLS, multiple: true, "data-place": "boards" })),
    make("div", { class: "row wrap" },
      picker("Choose videos", add, { accept: VIDEOS, multiple: true, "data-videos": "boards" }),
      picker("Choose a folder of all cameras", add, { webkitdirectory: true, "data-folder": "boards" }),
      make("small", { class: "note" }, "videos and folders are named as their camera"))), take);
  const start = () => begin(step, holder, { command: "intrinsics", settings: { ...step.typed.look, ...step.typed.intrinsics } });
  return section("2", "Lenses", "lenses",
    make("p", {}, "For each camera 15 to 30 pictures of the board, or a video of half a minute: near and far, in all parts of the picture, tilted both ways, held still."),
    step.boards, card, holder, ...starter("Calibrate the lenses", "start_lenses", start, "lenses"));
}

// 3: the board carried through the room, or points that were clicked.
function positionPart(step) {
  const of = make("select", { id: "positions_of" }, make("option", { value: "boards" }, "the carried board"), make("option", { value: "points" }, "points clicked in Check"));
  if (!step.known.files.some((file) => file.place === "board_walk") && step.known.points) of.value = "points";
  const from = labelled("found from", of, make("p", { class: "note" }, `${step.known.points || "No"} point${step.known.points === 1 ? " has" : "s have"} world coordinates; four are needed, better eight.`));
  const holder = settings(step, "extrinsics", "rig", "extrinsics", [from]);
  step.walk = make("div");
  step.rig = make("div");
  const start = () => begin(step, holder, { command: "extrinsics", of: of.value, settings: { ...(of.value === "boards" ? step.typed.look : {}), ...step.typed.extrinsics } });
  step.typed.boards.by ??= "board";
  const times = settings(step, "sync", "walk", "boards");
  const keep = () => begin(step, times, { command: "sync", of: "boards", settings: { ...(["auto", "board"].includes(step.typed.boards.by) ? step.typed.look : {}), ...step.typed.boards } });
  return section("3", "Positions", "positions",
    make("p", {}, "Fix the cameras, start them, clap once. Lay the board on the floor, face up; then carry it slowly through the room, always in view of two cameras. One video for each camera, named as the pictures above."),
    step.walk,
    make("details", {}, make("summary", {}, "The videos were not started together"), make("div", { class: "inner" },
      make("p", { class: "note" }, "Finds the time of every frame, from the board's speed or from the clap."), times,
      ...starter("Put them in step", "start_walk_times", keep, "walk_times", ""))),
    holder, ...starter("Calibrate the positions", "start_positions", start, "positions"), step.rig);
}

// 4: the take itself.
function timePart(step) {
  const holder = settings(step, "sync", "take", "take");
  const start = () => begin(step, holder, { command: "sync", of: "take", settings: step.typed.take });
  step.times = make("div");
  return section("4", "The take in step", "times",
    make("p", {}, "Only if the cameras were not triggered together, as telephones and webcams. From the silhouettes of somebody who moves, or from a clap; with the calibration to about a millisecond."),
    holder, step.times, ...starter("Find the times", "start_times", start, "times", ""));
}

// What is typed here stays whatever files come and jobs end.
function drawLook(step) {
  const look = (names) => Object.entries(names).map(([name, title]) => {
    const made = field(step.known.forms.intrinsics.find((row) => row.name === name), step.typed.look, "look");
    made.querySelector("label").textContent = title;
    return made;
  });
  step.look.replaceChildren(make("div", { class: "fields" }, ...look({ board: "inner corners", square: "square, m" })),
    make("details", { open: Boolean(step.typed.look.marker) }, make("summary", {}, "Markers", make("small", {}, "of a ChArUco board")), make("div", { class: "fields" }, ...look({ marker: "marker, m", dictionary: "dictionary" }))));
}

function drawFiles(step) {
  const { known } = step;
  step.sheet.hidden = !known.sheet;
  const of = (place) => known.files.filter((file) => file.place === place);
  if (!step.named) step.camera.value = freeName("cam_", of("boards").map(stemOf));
  step.boards.replaceChildren(...lensCards(step, of("boards")));
  const add = (place) => (files) => step.studio.uploads.take(files, step.project, place);
  step.walk.replaceChildren(dropTarget(make("section", { class: "card" },
    fileList(step, of("board_walk")),
    known.in_step.boards && make("p", { class: "note" }, "timestamps.csv tells the time of every frame."),
    make("div", { class: "row wrap" },
      picker("Choose videos", add("board_walk"), { accept: `${VIDEOS},${STILLS}`, multiple: true, "data-place": "board_walk" }),
      picker("Choose a folder", add("board_walk"), { webkitdirectory: true, "data-folder": "board_walk" }))), add("board_walk")));
  step.rig.replaceChildren(...rigFindings(step));
  step.times.replaceChildren(known.in_step.take ? make("p", { class: "note" }, "timestamps.csv tells the time of every frame; it is written anew.") : "");
  allowStarts(step);
}

// Nothing begins while files are still coming, which it would not see.
function allowStarts(step) {
  const reason = step.studio.uploads.waiting ? "Files are still being copied." : step.busy ?? "";
  for (const start of step.holders.querySelectorAll("button[data-calibrate]")) allow(start, reason);
}
