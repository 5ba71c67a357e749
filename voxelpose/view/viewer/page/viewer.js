// The viewer: the player, with the hulls and pictures of frames that are asked for one after the other.

import { getJson } from "./api.js";
import { Corrections } from "./corrections.js";
import { checkbox, choice, make, notice, swatch } from "./elements.js";
import { FrameStore } from "./frame_store.js";
import { Hull, hullLegend } from "./hull.js";
import { Player } from "./player.js";
import { barOfStudio } from "./job_bar.js";
import { LIKELY, UNLIKELY, drawPictures, filmed, otherPoses, part } from "./shown_frame.js";

const LATE_S = 0.2;  // that hull and pictures may be late while playing

// What the player's page lacks.
function addParts() {
  part("view").append(make("p", { class: "follows", role: "status", hidden: true }));
  part("layers").parentElement.after(
    make("section", { class: "told", "aria-live": "polite" }, make("h2", {}, "This frame"),
      make("div", { class: "lines" }, make("p", {}, "Reading the recording …"))));
  part("keys").append(make("p", {}, "Body and skeleton play at true speed. Hull and pictures follow as they are carved: frames that are there are underlined below the strip."));
}

class Viewer {
  constructor(state) {
    this.state = state;
    this.cameraKind = "both";
    this.hull = new Hull(state);
    this.largest = {};
    this.store = new FrameStore(
      (frame) => getJson(`api/frame?frame=${frame}&pictures=${this.cameraKind}`), (frame) => this.arrived(frame), (text) => this.failed(text));
    this.cameraChoice = choice("Cameras show", [["both", "picture and silhouette"], ["picture", "picture"],
      ["silhouette", "silhouette"], ["none", "no picture"]], "both", (kind) => {
      this.cameraKind = kind;
      this.store.forget();
      this.backdropKey = "";
      this.changed();
    });
    this.cameraChoice.hidden = !state.filmed;
    addParts();
    this.player = new Player(document.body, state, this);
    if (state.corrections) part("told").after(new Corrections(state, this.player).section);
    this.player.timeline.loaded = (index) => this.store.has(state.first + index);
    this.#linkBack();
    this.changed();
  }

  // To the studio, whose page shows this one below an address of its own.
  #linkBack() {
    const studio = barOfStudio();
    if (!studio) return;
    const result = location.pathname.slice(studio.length + "view/".length, -"/-/".length);
    const project = result.includes("/") ? "" : this.state.recording;
    const address = `${studio}#view/${encodeURIComponent(project)}/${encodeURIComponent(decodeURIComponent(result))}`;
    document.querySelector("h1").before(make("a", { href: address, target: "_top" }, "← Studio"));
  }

  layers(player) {
    player.shown.hull = this.state.carved;
    player.shown.hypotheses = this.state.hypotheses;
    const layers = [];
    if (this.state.carved) layers.push(this.hull.controls(player));
    if (this.state.hypotheses) {
      layers.push(make("div", { class: "layer" }, checkbox("Other likely poses", true, (on) => player.show("hypotheses", on))));
    }
    return layers;
  }

  legend(player) {
    const lines = this.state.carved && player.shown.hull ? hullLegend(this.hull, player, this.state) : [];
    if (this.state.hypotheses && player.shown.hypotheses) {
      lines.push(swatch([LIKELY, UNLIKELY].map((grey) => [grey, grey, grey]), "other poses that the camera leaves open, likely to unlikely"));
    }
    return lines;
  }

  // Another frame is shown, or something else: what is there of it is drawn, the rest is asked for.
  changed() {
    const { player, store } = this;
    if (!player) return;
    const { frame, playing } = player.timeline;
    if (!this.waits) {
      store.want(frame, playing ? this.state.fps * player.timeline.speed : 0, this.state);
      if (store.has(frame)) this.use(frame);
    }
    if (!playing) this.backdropPicture();
    this.tell();
  }

  failed(text) {
    notice(text);
    this.tell();
  }

  // A frame's answer is here. While playing, the newest is shown.
  arrived(frame) {
    const { timeline } = this.player;
    if (frame === timeline.frame || (timeline.playing && !this.store.has(timeline.frame))) this.use(frame);
    timeline.draw();
    this.tell();
  }

  async use(frame) {
    if (this.used === frame && this.usedKind === this.cameraKind) return;
    const answer = this.store.get(frame);
    Object.assign(this, { used: frame, usedKind: this.cameraKind });
    this.hull.take(answer.hull, this.player);
    this.others = otherPoses(this.player.renderer, answer.hypotheses, this.others);
    this.player.redraw();
    const { cameras, renderer } = this.player;
    const images = await Promise.all(cameras.map(({ name }) => {
      const sent = answer.pictures[name];
      return sent ? createImageBitmap(jpeg(sent)) : null;
    }));
    cameras.forEach((camera, k) => {
      if (this.used !== frame) return images[k]?.close();
      camera.empty = !images[k];
      return images[k] && filmed(renderer, camera, images[k]);
    });
    this.player.redraw();
  }

  link(frame) {
    const { silhouettes } = this.state;
    return silhouettes ? make("a", { href: `${silhouettes}/?frame=${frame}`, target: silhouettes },
      "Why is a pixel the person? Silhouettes step by step") : "";
  }

  tell() {
    const { timeline } = this.player;
    const lost = this.store.lost === timeline.frame;  // the banner says why
    part("follows").hidden = !this.state.filmed || lost || (this.used === timeline.frame && !this.waits);
    part("follows").textContent = this.waits ? "hull and pictures come back with a pause: there is no graphics card here"
      : timeline.playing ? "hull and pictures follow as they are carved" : "carving this frame …";
    this.#numbers();
  }

  // What is said about the shown frame, and about no other one.
  #numbers() {
    const { timeline, people } = this.player;
    const told = !timeline.playing && this.store.has(timeline.frame) ? timeline.frame : null;
    const key = `${told} ${timeline.playing} ${people}`;
    if (key === this.toldKey) return;
    this.toldKey = key;
    if (told === null) return part("lines").replaceChildren(make("p", {}, timeline.playing ? "A pause shows the numbers of its frame." : "…"));
    const { lines, notes } = this.store.get(told);
    part("lines").replaceChildren(
      ...lines.filter(({ person }) => person === null || people[person]).map(({ text }) => make("p", {}, text)),
      ...notes.map((note) => make("p", { class: "warning" }, `⚠ ${note}`)), this.link(told));
  }

  // Somebody is shown or hidden, with hull and numbers.
  persons() {
    this.hull.build(this.player);
    this.tell();
  }

  // While all is drawn by the processor, only what was sent once plays.
  get waits() {
    return this.player.renderer.slow && this.player.timeline.playing;
  }

  // Whether hull and pictures are of another moment than the shown one: they would be beside the body.
  late() {
    const { timeline, scene } = this.player;
    return this.waits || Math.abs(timeline.frame - this.used) > (timeline.playing ? LATE_S * scene.fps : 0);
  }

  pictures(player) {
    if (!this.waits) drawPictures(player);
  }

  // Behind the scene, through a camera: its picture, with the outlines of the bodies.
  backdrop(player, camera) {
    const { clientWidth: width, clientHeight: height } = player.canvas;
    const [scale, left, top] = camera.fitted(width, height);
    const x = [left, left + scale * camera.size[0]].map((value) => (2 * value) / width - 1);
    const y = [top, top + scale * camera.size[1]].map((value) => 1 - (2 * value) / height);
    const texture = this.large?.camera === camera && this.large.frame === player.timeline.frame ? this.large.texture : !camera.empty && camera.texture;
    const corners = [[x[0], y[0], 0], [x[1], y[0], 0], [x[1], y[1], 0], [x[0], y[1], 0]];
    if (texture) player.renderer.drawPicture(texture, corners, this.late() ? 0.25 : 1, true);
  }

  looked(camera) {
    this.through = camera;
    this.large = null;
    this.backdropKey = "";
    if (camera) this.backdropPicture();
  }

  async backdropPicture() {
    const camera = this.through;
    const kind = this.cameraKind === "none" ? "picture" : this.cameraKind;
    const { frame } = this.player.timeline;
    const path = camera && `picture/${encodeURIComponent(camera.name)}?frame=${frame}&pictures=${kind === "both" ? "picture" : kind}`;
    if (!camera || !this.state.filmed || path === this.backdropKey) return;
    this.backdropKey = path;
    const answer = await fetch(path);
    if (!answer.ok || this.backdropKey !== path) return;
    const image = await createImageBitmap(await answer.blob());
    if (this.through === camera && this.backdropKey === path) this.enlarged(camera, frame, image);
  }

  enlarged(camera, frame, image) {
    filmed(this.player.renderer, this.largest, image);
    this.large = { camera, texture: this.largest.texture, frame };
    this.player.redraw();
  }

  over(player) {
    if (player.shown.hypotheses && this.others && !this.late()) player.renderer.drawSolid(this.others);
  }

  draw(player) {
    if (player.shown.hull && !this.late()) this.hull.draw(player);
  }
}

const jpeg = (text) => new Blob([Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0))], { type: "image/jpeg" });

try {
  window.viewer = new Viewer(await getJson("api/scene"));
} catch (error) {
  notice(error.message);
}
