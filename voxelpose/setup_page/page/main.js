// The page: cameras in the middle, steps at the side, time below.

import { postJson } from "./api.js";
import { CamerasPage, openPage } from "./cameras_page.js";
import { DrawingPointer, polygonsOf } from "./drawing_pointer.js";
import { checkPanel, floorPanel, silhouettesPanel } from "./findings.js";
import { Loupe } from "./loupe.js";
import { Overlays } from "./overlays.js";
import { placesPanel, pointsPanel } from "./panels.js";
import { button, by, checkbox, make, notice } from "./elements.js";
import { pointActions } from "./point_actions.js";
import { JobBar } from "./job_bar.js";
import { addRail, addressOf } from "./rail.js";
import { Store } from "./store.js";

const STEPS = [
  ["region", "Region of interest", "#50c878", (app) => placesPanel(app, "region")],
  ["unknown", "Unknown places", "#ff9628", (app) => placesPanel(app, "unknown")],
  ["points", "Scene points", "#ffd23f", pointsPanel],
  ["silhouettes", "Silhouettes and settings", "#40c8ff", silhouettesPanel],
  ["check", "Check the cameras", "#b99cff", checkPanel],
  ["floor", "Up and the floor", "#f2f4f6", floorPanel],
];

class SetupPage extends CamerasPage {
  constructor(state) {
    super(state, "setup", DrawingPointer, ". What you drew is still here: start it again at the same port, and save.");
    this.store = new Store(state);
    this.tool = "region";
    this.chosen = this.draft = null;
    this.point = state.points[0]?.name ?? null;
    this.typed = {};
    this.errors = {};
    this.stage = "picture"; // of the silhouettes
    this.ground = false;
    this.silhouetteNote = "";
    this.height = 0;
    this.check = { state: "idle" };
    this.build(state);
    this.overlays = new Overlays(this);
    this.store.addEventListener("change", () => this.changed());
    this.changed();
    this.seek(this.moment);
    new JobBar(state.studio, (jobs) => this.watchCheck(jobs));
  }

  // What the page of cameras lacks.
  build(state) {
    const tool = (id, text, title, onclick, kind = "quiet") => button(text, onclick, { id, title, class: kind, disabled: true });
    document.querySelector("header").append(
      make("div", { class: "push" }), make("p", { id: "saving", role: "status" }),
      tool("undo", "Undo", "Undo (Ctrl+Z)", () => this.undo()), tool("redo", "Redo", "Redo (Ctrl+Shift+Z)", () => this.redo()),
      tool("save", "Save", "Write the changes into the recording's folder (Ctrl+S)", () => this.save(), "main"));
    if (state.studio) {
      addRail("check", state.studio, state.name);
      document.querySelector("h1 span").textContent = "studio";
      document.querySelector("header").append(make("a", { id: "next", class: "button", href: addressOf("fit", state.studio, state.name) }, "Next: Estimate"));
    }
    if (state.fault) by("banner").after(make("div", { id: "fault", role: "note" }, `This folder is not ready yet: ${state.fault}`));
    const empty = checkbox("Empty view", false, () => this.seek(this.moment), { id: "empty" });
    by("moment_text").after(Object.assign(empty, { hidden: !state.cameras.some((camera) => camera.empty), title: "The pictures in background/" }));
    document.body.append(
      make("canvas", { id: "loupe", width: 216, height: 216, hidden: true }),
      make("dialog", { id: "picture" }, make("img", { alt: "" }), make("form", { method: "dialog" }, make("button", { class: "main" }, "Close"))));
    this.loupe = new Loupe(by("loupe"));
    this.watchPanel();
    document.addEventListener("keydown", (event) => this.key(event));
    addEventListener("beforeunload", (event) => {
      if (!this.store.dirty && !this.draft) return;
      event.preventDefault();
      event.returnValue = true; // for browsers that ask only then
    });
    this.arrange();
  }

  cameraState(name) {
    return this.store.state.cameras.find((camera) => camera.name === name);
  }

  scene(name) {
    const { doc } = this.store;
    return {
      tool: this.tool,
      region: doc.regions[name],
      unknown: doc.unknown[name],
      points: doc.points,
      errors: this.errors,
      point: this.point,
      chosen: name === this.large ? this.chosen : null,
      draft: this.draft?.camera === name ? this.draft : null,
      stage: by("empty").checked ? "picture" : this.stage,
      ground: this.ground,
    };
  }

  // After a change of the document.
  changed() {
    const { store } = this;
    if (this.chosen && this.large) {
      const polygon = polygonsOf(store.doc, this.chosen.kind, this.large)[this.chosen.index];
      if (!polygon) this.chosen = null;
    }
    by("undo").disabled = !store.past.length;
    by("redo").disabled = !store.future.length;
    by("save").disabled = !store.dirty;
    if (store.dirty) this.status(`not saved: ${store.dirtyParts.join(", ")}`);
    else if (!by("saving").classList.contains("done")) this.status("");
    this.overlays.update();
    this.show();
  }

  status(text, done = false) {
    by("saving").textContent = by("saving").title = text;
    by("saving").classList.toggle("done", done);
  }

  show() {
    for (const view of this.views.values()) view.draw();
    this.hint();
    this.renderSoon();
  }

  // Draws the side panel when nothing in it is pressed or being typed, which would be lost.
  renderSoon() {
    clearTimeout(this.rendering);
    this.rendering = setTimeout(() => {
      if (!this.pressed && !this.typing) this.render();
    });
  }

  watchPanel() {
    const tools = by("tools");
    const release = () => {
      this.pressed = false;
      this.renderSoon();
    };
    tools.addEventListener("pointerdown", () => (this.pressed = true));
    addEventListener("pointerup", release);
    addEventListener("pointercancel", release);
    tools.addEventListener("input", (event) => {
      if (event.target.matches("[type=text], [type=number]")) this.typing = true;
    });
    for (const end of ["change", "focusout"]) {
      tools.addEventListener(end, () => {
        if (this.replacing) return; // a field that is replaced loses the focus, and gets it back
        this.typing = false;
        this.renderSoon();
      }, true);
    }
  }

  render() {
    const tools = by("tools");
    const { id: focus, selectionStart, selectionEnd } = document.activeElement ?? {};
    const { scrollTop } = tools;
    this.replacing = true;
    tools.replaceChildren(...STEPS.map(([tool, title, colour, panel]) => {
      const open = tool === this.tool;
      const dot = make("i");
      dot.style.background = colour;
      const step = make("section", { class: `step${open ? " open" : ""}` },
        make("button", { onclick: () => this.use(tool), "aria-expanded": open, "data-tool": tool },
          dot, make("b", {}, title), make("small", {}, this.badge(tool))));
      if (open) step.append(make("div", { class: "body" }, ...panel(this)));
      return step;
    }));
    tools.scrollTop = scrollTop;
    const wanted = this.wanted ?? focus;
    const field = wanted ? tools.querySelector(`#${CSS.escape(wanted)}`) : null;
    field?.focus();
    if (this.wanted) field?.select();
    else if (field?.type === "text") field.setSelectionRange(selectionStart, selectionEnd);
    this.wanted = null;
    this.replacing = false;
  }

  badge(tool) {
    const { doc, state } = this.store;
    if (tool === "region" || tool === "unknown") {
      const painted = (camera) => (tool === "region" ? camera.painted_region && doc.regions[camera.name].painted : camera.painted_unknown);
      const count = state.cameras.filter((camera) => polygonsOf(doc, tool, camera.name).length || painted(camera)).length;
      return count ? `${count} of ${state.cameras.length} cameras` : "";
    }
    if (tool === "points") return doc.points.length ? String(doc.points.length) : "";
    if (tool === "silhouettes") return this.stage === "picture" ? "" : "shown";
    if (tool === "check") {
      if (state.refused.check) return "not here";
      return this.check.state === "done" ? (this.check.agrees ? "agree" : "look here") : "";
    }
    if (state.refused.floor) return "not here";
    return this.ground ? "shown" : doc.fit.up ?? "";
  }

  hint() {
    const many = this.views.size > 1;
    let text = many ? "Click a camera to enlarge it." : "Click the picture to work on it.";
    if (this.large) {
      const does = {
        region: "Click corners of the region.", unknown: "Click corners of what is hidden.",
        points: this.point ? `Click where ${this.point} is.` : "Click a place: it becomes a new point.",
        silhouettes: "Point at a pixel: this line tells what it is taken for, and why.",
      }[this.tool] || "";
      const closing = "Click the first corner, or press Enter, to close; Backspace takes one back.";
      text = `${this.draft ? closing : does} Wheel zooms, dragging moves the picture, Esc goes back.`;
    }
    by("hint").textContent = text.trim();
  }

  use(tool) {
    this.tool = tool;
    this.draft = this.chosen = null;
    this.loupe.hide();
    this.overlays.explain(null);
    if (tool === "floor" && !this.ground && !this.store.state.refused.floor) this.set({ ground: true });
    if (tool === "silhouettes" && this.stage === "picture") this.set({ stage: "silhouette" });
    this.show();
  }

  enlarge(name) {
    if (name !== this.large) this.draft = this.chosen = null;
    this.large = name;
    this.loupe.hide();
    this.overlays.explain(null);
    this.arrange();
    this.show();
  }

  pathOf(view) {
    if (!by("empty").checked) return `picture/${encodeURIComponent(view.name)}?moment=${this.moment}`;
    return this.cameraState(view.name).empty ? `picture/${encodeURIComponent(view.name)}` : null;
  }

  loadMoment() {
    const { times_s, numbers } = this.store.state;
    const time = times_s ? `  ·  ${times_s[this.moment].toFixed(2)} s` : "";
    this.timeText(by("empty").checked ? "empty view" : `frame ${numbers?.[this.moment] ?? this.moment}${time}`);
    this.overlays.update();
  }

  key(event) {
    const command = event.ctrlKey || event.metaKey;
    const typing = event.target.matches("input:not([type=range], [type=checkbox]), select");
    const key = event.key.toLowerCase();
    if (command && key === "s") {
      document.activeElement?.blur(); // what is being typed counts
      this.save();
    } else if (typing || by("picture").open) {
      return;
    } else if (command && key === "z") {
      if (event.shiftKey) this.redo();
      else this.undo();
    } else if (command && key === "y") {
      this.redo();
    } else if (command || event.altKey || (event.target.matches("input") && event.key.startsWith("Arrow"))) {
      return;
    } else if (event.key === "Enter" && event.target.matches("button") && !this.draft) {
      return;
    } else if (!this.large || !this.pointer.key(this.views.get(this.large), event)) {
      return;
    }
    event.preventDefault();
  }

  undo() {
    if (this.draft) {
      this.draft.corners.pop();
      if (!this.draft.corners.length) this.draft = null;
      this.show();
    } else {
      this.typed = {};
      this.store.undo();
    }
  }

  redo() {
    this.typed = {};
    this.store.redo();
  }

  removePolygon(kind, camera, index) {
    this.chosen = null;
    this.store.change(`remove ${Math.random()}`, (doc) => polygonsOf(doc, kind, camera).splice(index, 1));
  }

  setFit(name, value) {
    this.store.change(`fit ${name}`, (doc) => (doc.fit[name] = value));
  }

  useCamera(name, used) {
    const all = this.store.state.cameras.map((camera) => camera.name);
    const now = this.store.doc.fit.cameras ?? all;
    const chosen = all.filter((each) => (each === name ? used : now.includes(each)));
    if (chosen.length) this.setFit("cameras", chosen.length === all.length ? null : chosen);
    this.show();
  }

  // Shows something else: another stage, another height of the floor ...
  set(changes) {
    Object.assign(this, changes);
    this.overlays.update();
    this.show();
  }

  enlargePicture(source) {
    by("picture").querySelector("img").src = source;
    by("picture").showModal();
  }

  // Shows the check of this folder whenever it begins or ends.
  watchCheck(jobs) {
    const before = this.check;
    this.check = jobs.findLast(({ kind, of }) => kind === "check" && of === this.store.state.name) ?? { state: "idle" };
    if (this.check.number !== before.number || this.check.state !== before.state) this.show();
  }

  async repair() {
    if (await this.ask("api/check/repair")) location.reload();
  }

  // Asks for something; null where that is refused, which is told on top.
  ask(path) {
    return postJson(path, {}).catch((error) => notice(error.message));
  }

  async save() {
    if (!this.store.dirty || this.isSaving) return;
    this.isSaving = true;
    const sent = structuredClone(this.store.doc);
    this.status("saving …");
    try {
      const seen = this.overrides ? "" : this.store.state.seen;
      const { meanwhile, written, removed, left_out, state } = await postJson("api/save", { ...this.store.changes(), seen });
      this.overrides = Boolean(meanwhile);
      if (meanwhile) throw new Error(meanwhile);
      notice("");
      const words = [];
      if (written.length) words.push(`written: ${written.join(", ")}`);
      if (removed.length) words.push(`removed: ${removed.join(", ")}`);
      if (left_out.length) words.push(`not yet clicked, so not saved: ${left_out.join(", ")}`);
      this.overlays.forgetPainted();
      this.store.adopt(state, sent);
      this.status(words.join("; ") || "nothing to write", !left_out.length);
    } catch (error) {
      this.status(`not saved: ${error.message}`);
      notice(`Not saved: ${error.message}`);
    } finally {
      this.isSaving = false;
    }
  }
}

Object.assign(SetupPage.prototype, pointActions);

await openPage(SetupPage);
