// The player: bodies, skeletons, cameras and floor of a scene that was sent once, over time.

import { Body } from "./body.js";
import { checkbox, choice, css, make, swatch } from "./elements.js";
import { Renderer, boneFaces, jointFaces } from "./renderer.js";
import { Pinhole, add, minus, mixed, norm, scaled } from "./space.js";
import { Timeline } from "./timeline.js";
import { Viewpoint } from "./viewpoint.js";

export const CLAY = [214, 205, 192];
const UNKNOWN = [120, 128, 136];
// Left and right stay apart for every kind of colour vision: blue against orange, whose bones are
// dashed, as in the overlays.
const DASHES = [[0, 0.4], [0.6, 1]];
const SIDES = { left: [58, 158, 255], right: [255, 130, 38], middle: [110, 214, 196] };
// Vermilion over yellow to blue, likewise.
const RAMP = [[213, 62, 20], [244, 190, 60], [64, 132, 214]];
const CAMERA = [150, 164, 178, 255];
const JOINTS = [245, 245, 240];
const JOINT = 0.024;  // width of a joint's mark, m
const STILL_MS = 250;  // after which a picture that stays is drawn finely

// Colour of a fraction from 0 to 1.
export function ramp(share) {
  if (Number.isNaN(share)) return UNKNOWN;
  const at = Math.min(Math.max(share, 0), 1) * (RAMP.length - 1);
  const low = Math.min(Math.floor(at), RAMP.length - 2);
  return mixed(RAMP[low], RAMP[low + 1], at - low).map(Math.round);
}

const shownName = (body) => body.name.replaceAll("_", " ");
const sideOf = (part) => (part.startsWith("left_") ? "left" : part.startsWith("right_") ? "right" : "middle");

// A colour for every part: neighbours, left and right differ.
export function partColour(index, count) {
  const hue = (index * 0.381966 * 360) % 360;
  const light = 0.5 + 0.16 * ((index % 3) - 1);
  const [c, h] = [(1 - Math.abs(2 * light - 1)) * 0.72, hue / 60];
  const x = c * (1 - Math.abs((h % 2) - 1));
  const rgb = [[c, x, 0], [x, c, 0], [0, c, x], [0, x, c], [x, 0, c], [c, 0, x]][Math.floor(h) % 6];
  return count ? rgb.map((value) => Math.round(255 * (value + light - c / 2))) : UNKNOWN;
}

export class Player {
  // Shows a scene within an element that has the page's parts; `extras` may draw more: `draw(player)`,
  // `legend()`, `changed(index)` for a frame that is shown, `looked(camera)` through a camera, or null.
  constructor(root, scene, extras = {}) {
    const part = (name) => root.querySelector(`.${name}`);
    Object.assign(this, { scene, extras, part, canvas: part("space"), labels: part("labels") });
    root.querySelector("h1").textContent = scene.name;
    if (scene.count > 1) root.querySelector("header small").textContent = `${scene.count} frames, ${(scene.count / scene.fps).toFixed(1)} s`;
    if (scene.corrected) root.querySelector("header small").append(make("span", { title: scene.corrected }, " · corrected by hand"));
    this.bodies = scene.bodies.map((sent) => new Body(sent));
    this.cameras = scene.cameras.map((sent) => new Pinhole(sent));
    this.renderer = new Renderer(this.canvas);
    this.skins = this.bodies.map((body) => this.renderer.skin(body));
    this.shown = { cameras: true, body: true, skeleton: true };
    this.people = this.bodies.map(() => true);
    this.sided = this.bodies.some((body) => body.parts.some((name) => sideOf(name) !== "middle"));
    this.colouring = this.bodies.length > 1 ? "person" : this.sided ? "sides" : "plain";
    this.follows = true;
    this.spread = true;
    this.viewpoint = new Viewpoint(this.canvas, scene, () => this.redraw(), () => this.#looked(null));
    this.timeline = new Timeline(part("timeline"), scene, this.bodies, this.people, (index) => this.#frame(index), (share) => css(ramp(share)));
    this.#makeCameras();
    this.#makePanel();
    new ResizeObserver(() => this.redraw()).observe(this.canvas);
    this.canvas.addEventListener("pointerup", (event) => this.#click(event));
    document.addEventListener("keydown", (event) => {
      if (event.key === "Escape" && this.viewpoint.pinhole) this.viewpoint.goHome();
      else if (event.key === "f" && !event.ctrlKey && !event.metaKey && !event.target.matches("select, input:not([type=checkbox])")) this.fit();
    });
    this.timeline.seek((scene.shown ?? scene.first + Math.floor(scene.count / 2)) - scene.first);
    this.#readAddress();
    addEventListener("hashchange", () => this.#readAddress());
    this.drawn = 0;
    this.showLegend();
    const tick = (now) => {
      this.timeline.tick(now);
      const still = !this.wanted && now - this.drawnAt > STILL_MS;
      if (this.wanted || (still && !this.fine)) this.#draw(now, still || !this.renderer.slow);
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  redraw() {
    this.wanted = true;
  }

  row(k) {
    return this.people[k] ? this.bodies[k].rows[this.timeline.index] : -1;
  }

  #frame(index) {
    this.bodies.forEach((body, k) => body.rows[index] >= 0 && this.#place(body, k, body.rows[index]));
    if (this.follows) this.#follow();
    if (!this.timeline.playing) this.#writeAddress();
    this.skeleton = null;
    this.extras.changed?.(index);
    this.redraw();
  }

  // The address tells the frame and the loop, so that it leads there again.
  #writeAddress() {
    const { frame, loop, whole } = this.timeline;
    const words = `#frame=${frame}${whole.hidden ? "" : `&loop=${loop.map((index) => this.scene.first + index).join("-")}`}`;
    clearTimeout(this.address);
    if (this.scene.count > 1) this.address = setTimeout(() => history.replaceState(null, "", words), 200);
  }

  #readAddress() {
    const asked = new URLSearchParams(location.hash.slice(1));
    const { first } = this.scene;
    const [from, to] = (asked.get("loop") ?? "").split("-").map((text) => parseInt(text, 10) - first);
    if (from < to) this.timeline.range(from, to);
    const frame = parseInt(asked.get("frame"), 10);
    if (frame >= 0) this.timeline.seek(frame - first);
  }

  // Shows all of everybody, or of the cameras where there is nobody.
  fit() {
    const shown = this.bodies.filter((_, k) => this.row(k) >= 0);
    const points = shown.length ? shown.flatMap((body) => body.skeleton()) : this.cameras.map(({ center }) => center);
    if (!points.length) return;
    const ends = [Math.min, Math.max].map((end) => [0, 1, 2].map((k) => end(...points.map((point) => point[k]))));
    this.viewpoint.fit(mixed(...ends, 0.5), Math.max(0.55 * norm(minus(...ends)), 0.3));
  }

  #place(body, k, row) {
    const { apart } = this.scene;
    // Through a camera everybody is where he was.
    body.place(row, scaled(apart, this.spread && !this.viewpoint.pinhole ? body.result : 0));
    const colours = new Uint8Array(3 * body.count);
    for (let part = 0; part < body.count; part++) colours.set(this.#partColour(body, row, part), 3 * part);
    this.renderer.place(this.skins[k], body.places, colours);
  }

  #partColour(body, row, part) {
    switch (this.colouring) {
      case "person": return body.colour ?? CLAY;
      case "parts": return partColour(part, body.count);
      case "inside": return ramp(body.inside(row, part));
      case "sides": return mixed(SIDES[sideOf(body.parts[part])], CLAY, 0.55).map(Math.round);
      default: return CLAY;
    }
  }

  // Lines of everybody's skeleton, of the shown frame.
  #bones() {
    const [faces, normals, colours] = [[], [], []];
    this.bodies.forEach((body, k) => {
      if (this.row(k) < 0) return;
      const points = body.skeleton();
      const size = norm(minus(this.scene.eye, this.scene.look_at)) / 3.2;
      for (let bone = 0; bone < body.bones.length / 2; bone++) {
        const [start, end] = [points[body.bones[2 * bone]], points[body.bones[2 * bone + 1]]];
        const width = Math.min(0.016, 0.16 * norm(minus(end, start))) * Math.min(size, 1.2);
        const before = faces.length;
        const side = sideOf(body.parts[body.partOf(bone)]);
        for (const dash of side === "right" ? DASHES : [[0, 1]]) boneFaces(...dash.map((at) => mixed(start, end, at)), width, faces, normals);
        const colour = body.colour ? mixed(body.colour, [255, 255, 255], 0.5) : SIDES[side];
        for (let n = before; n < faces.length; n += 3) colours.push(...colour);
      }
      for (const end of new Set(body.bones)) jointFaces(points[end], JOINT, faces, normals);
      while (colours.length < faces.length) colours.push(...JOINTS);
    });
    return this.renderer.surface(new Float32Array(faces), new Float32Array(normals), new Uint8Array(colours));
  }

  #draw(now, fine) {
    this.wanted = false;
    Object.assign(this, { fine, drawnAt: now });
    const { renderer, viewpoint, scene, shown } = this;
    const matrix = viewpoint.matrix(now);
    const { through } = viewpoint;
    renderer.begin(matrix, viewpoint.eyeNow, fine);
    if (through) this.extras.backdrop?.(this, through);
    const reach = Math.max(5, 2.2 * norm(minus(scene.eye, scene.look_at)));
    if (!through) renderer.drawFloor(scene.look_at, scene.floor_m, reach);
    if (shown.body && !through && viewpoint.eye[2] > scene.floor_m) {
      this.skins.forEach((skin, k) => this.row(k) >= 0 && renderer.drawShadow(skin.mesh, scene.floor_m + 0.002));
    }
    if (shown.cameras && !through) {
      renderer.drawLines(this.frusta);
      this.extras.pictures?.(this);
    }
    if (shown.body) this.skins.forEach((skin, k) => this.row(k) >= 0 && renderer.drawSolid(skin.mesh, 1, through && this.extras.backdrop ? 0.25 : 1));
    this.extras.draw?.(this);
    renderer.over();
    this.extras.over?.(this);
    if (shown.skeleton) this.#drawSkeleton();
    this.#placeLabels(matrix, through);
    this.drawn += 1;
  }

  #drawSkeleton() {
    if (!this.skeleton) {
      this.renderer.drop(this.lines);
      this.skeleton = this.lines = this.#bones();
    }
    this.renderer.drawSolid(this.skeleton);
  }

  #makeCameras() {
    const size = 0.13 * norm(minus(this.scene.eye, this.scene.look_at));
    this.depth = size;
    const ends = this.cameras.flatMap((camera) => {
      const corners = camera.corners(size);
      return corners.flatMap((corner, k) => [...camera.center, ...corner, ...corner, ...corners[(k + 1) % 4]]);
    });
    this.frusta = this.renderer.lines(new Float32Array(ends), new Uint8Array((4 * ends.length) / 3).map((_, k) => CAMERA[k % 4]));
    this.feet = this.cameras.map((camera) => mixed(...camera.corners(size).slice(2), 0.5));
    const buttons = (more) => this.cameras.map((camera) => make("button", {
      ...more, title: `Look through ${camera.name}`,
      onclick: (event) => {
        if (event.detail) event.target.blur();
        this.look(camera);
      } }, camera.name));
    this.buttons = buttons({ class: "camera", tabIndex: -1, "aria-hidden": "true" });
    this.chips = make("div", { class: "chips", role: "group", "aria-label": "Look through" }, ...buttons({ class: "chip" }));
    this.labels.replaceChildren(...this.buttons);
    this.back = this.part("back");
    this.back.addEventListener("click", () => this.viewpoint.goHome());
  }

  // Moves the view to a camera.
  look(camera) {
    this.viewpoint.flyTo(camera);
    this.#looked(camera);
  }

  #looked(camera) {
    this.back.hidden = !camera;
    [...this.chips.children].forEach((chip, k) => chip.setAttribute("aria-pressed", this.cameras[k] === camera));
    this.back.textContent = camera ? `✕ ${camera.name}` : "";
    this.extras.looked?.(camera);
    this.#frame(this.timeline.index);
  }

  #placeLabels(matrix, through) {
    this.buttons.forEach((button, k) => {
      const pixel = through || !this.shown.cameras ? null : this.viewpoint.pixel(matrix, this.feet[k]);
      button.hidden = !pixel || pixel[0] < 0 || pixel[1] < 0 || pixel[0] > this.canvas.clientWidth || pixel[1] > this.canvas.clientHeight;
      if (pixel) button.style.transform = `translate(${pixel[0].toFixed(1)}px, ${pixel[1].toFixed(1)}px) translate(-50%, 15%)`;
    });
    this.matrix = matrix;
  }

  // A click into a camera's picture looks through it.
  #click(event) {
    if (this.viewpoint.moved >= 4 || this.viewpoint.pinhole || !this.shown.cameras) return;
    const box = this.canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left, event.clientY - box.top];
    const hit = this.cameras.find((camera) => {
      const corners = camera.corners(this.depth).map((corner) => this.viewpoint.pixel(this.matrix, corner));
      if (corners.some((corner) => !corner)) return false;
      const sides = corners.map(([ax, ay], k) => {
        const [bx, by] = corners[(k + 1) % 4];
        return (bx - ax) * (y - ay) - (by - ay) * (x - ax);
      });
      return sides.every((side) => side > 0) || sides.every((side) => side < 0);
    });
    if (hit) this.look(hit);
  }

  // Who is not found for a while is where he was last, lest the view jumps.
  #follow() {
    const there = this.bodies.filter((body, k) => this.people[k] && body.origins).map((body) => body.origins[0]);
    if (there.length) this.viewpoint.follow(there.reduce((sum, point) => add(sum, point)).map((value) => value / there.length));
  }

  #makePanel() {
    const toggle = (name, words, more = null) => make("div", { class: "layer" },
      checkbox(words, this.shown[name], (on) => this.show(name, on)), more);
    const ways = [["plain", "clay"], ["parts", "parts"]];
    if (this.sided) ways.unshift(["sides", "left and right"]);
    if (this.bodies.length > 1) ways.unshift(["person", this.bodies.some((body) => body.result) ? "results" : "people"]);
    if (this.bodies.some((body) => body.overlap)) ways.push(["inside", "share inside the hull"]);
    const colours = choice("Colours of the body", ways, this.colouring, (value) => this.colour(value));
    this.part("layers").replaceChildren(
      ...(this.cameras.length ? [toggle("cameras", "Cameras", this.extras.cameraChoice), this.chips] : []),
      ...(this.bodies.length ? [toggle("body", "Body", colours)] : []),
      ...(this.bodies.some((body) => body.bones.length) ? [toggle("skeleton", "Skeleton")] : []),
      ...(this.bodies.length > 1 ? this.bodies.map((body, k) => make("div", { class: "layer" }, checkbox(
        shownName(body), true, (on) => this.showPerson(k, on)))) : []),
      ...(this.bodies.some((body) => body.result) ? [make("div", { class: "layer" }, checkbox("Results side by side", true, (on) => {
        this.spread = on;
        this.#frame(this.timeline.index);
      }))] : []),
      ...(this.extras.layers?.(this) ?? []),
      ...(this.bodies.length ? [make("div", { class: "layer" }, checkbox("View follows the body", true, (on) => {
        this.follows = on;
        this.viewpoint.center = this.viewpoint.target;
        this.#frame(this.timeline.index);
      }))] : []),
    );
  }

  show(name, on) {
    this.shown[name] = on;
    this.extras.changed?.(this.timeline.index);
    this.showLegend();
    this.redraw();
  }

  showPerson(k, on) {
    this.people[k] = on;
    this.#frame(this.timeline.index);
    this.timeline.draw();
    this.extras.persons?.();
    this.showLegend();
  }

  colour(way) {
    this.colouring = way;
    this.#frame(this.timeline.index);
    this.showLegend();
  }

  showLegend() {
    const lines = [];
    const [first] = this.bodies;
    const { body, skeleton } = this.shown;
    const ends = [0, 0.25, 0.5, 0.75, 1].map(ramp);
    if (this.bodies.length > 1) this.bodies.forEach((one, k) => this.people[k] && lines.push(swatch([one.colour], shownName(one))));
    else if (this.sided && (skeleton || (body && this.colouring === "sides"))) {
      for (const side of ["left", "right", "middle"]) lines.push(swatch([SIDES[side]], `${side}: skeleton${side === "right" ? ", dashed," : ""} and body`));
    }
    if (first && body && this.colouring === "inside") {
      lines.push(swatch(ends, "body: share of the part inside the hull, 0 to 100 %"), swatch([UNKNOWN], "part too small to be measured"));
    }
    for (const measure of new Set(this.bodies.map((one) => one.measure))) {
      if (measure) lines.push(swatch(ends, `strip: ${measure[0].toLowerCase()}${measure.slice(1)}, 0 to 100 %`));
    }
    lines.push(...(this.extras.legend?.(this) ?? []));
    this.part("legend").replaceChildren(...lines);
  }
}
