// Time: a steady clock, its buttons and keys, and the confidence of every frame as a strip.

import { choice, css, make } from "./elements.js";

export const SPEEDS = [0.1, 0.25, 0.5, 1, 2];
const ROW = 12;

// The frame that a clock shows: how many have passed since it was started at a frame, at a rate
// in frames per second; it begins anew after the last.
export const frameAt = (started, elapsed_ms, rate, count) =>
  Math.floor((((started + (elapsed_ms / 1000) * rate) % count) + count) % count + 1e-6) % count;

export class Timeline {
  // `shown(index)` is told whenever another frame is shown, `colour(share)` gives that of a confidence.
  constructor(root, scene, bodies, shown, colour) {
    Object.assign(this, { scene, bodies, shown, colour, index: 0, playing: false, speed: 1, loaded: null });
    const single = scene.count < 2;
    this.button = make("button", { class: "play", onclick: () => this.toggle(), disabled: single });
    this.text = make("output", { class: "when" });
    this.strip = make("canvas", {
      class: "strip", tabIndex: 0, role: "slider", "aria-label": "Frame",
      "aria-valuemin": scene.first, "aria-valuemax": scene.first + scene.count - 1,
    });
    const speed = choice("Speed", SPEEDS.map((value) => [value, `${value}×`]), 1, (value) => this.faster(Number(value)));
    speed.disabled = single;
    root.replaceChildren(this.button, this.strip, this.text, speed);
    this.#label();
    this.#listen();
    new ResizeObserver(() => this.draw()).observe(this.strip);
  }

  get frame() {
    return this.scene.first + this.index;
  }

  seek(index) {
    this.index = Math.min(Math.max(Math.round(index), 0), this.scene.count - 1);
    this.#startClock();
    this.#show();
  }

  toggle(on = !this.playing) {
    this.playing = on && this.scene.count > 1;
    this.#startClock();
    this.#label();
    this.shown(this.index);
  }

  faster(speed) {
    this.speed = speed;
    this.#startClock();
  }

  // What the clock shows at a time in ms; whether that is another frame.
  tick(now) {
    if (!this.playing) return;
    const { started, began } = this.clock;
    const index = frameAt(started, now - began, this.scene.fps * this.speed, this.scene.count);
    if (index === this.index) return;
    this.index = index;
    this.#show();
  }

  #startClock() {
    this.clock = { started: this.index, began: performance.now() };
  }

  #show() {
    this.shown(this.index);
    this.draw();
  }

  #label() {
    this.button.textContent = this.playing ? "❚❚" : "▶";
    this.button.title = this.playing ? "Pause (space)" : "Play (space)";
    this.button.setAttribute("aria-label", this.playing ? "Pause" : "Play");
  }

  // Keys of the page; those that a field or a button takes are left to it.
  key(event) {
    const { target } = event;
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (target.matches("select, input:not([type=checkbox])") || (event.key === " " && target.matches("button, a, input, summary"))) return;
    const second = Math.round(this.scene.fps);
    const step = event.shiftKey ? second : 1;
    const last = this.scene.count - 1;
    const moves = {
      ArrowLeft: -step, ArrowRight: step, PageUp: -second, PageDown: second, Home: -this.index, End: last - this.index,
    };
    if (event.key === " ") this.toggle();
    else if (event.key in moves) {
      this.toggle(false);
      this.seek(this.index + moves[event.key]);
    } else return;
    event.preventDefault();
  }

  #listen() {
    document.addEventListener("keydown", (event) => this.key(event));
    const at = (event) => {
      const box = this.strip.getBoundingClientRect();
      this.seek(Math.floor(((event.clientX - box.left) / box.width) * this.scene.count));
    };
    this.strip.addEventListener("pointerdown", (event) => {
      this.strip.setPointerCapture(event.pointerId);
      at(event);
    });
    this.strip.addEventListener("pointermove", (event) => event.buttons & 1 && at(event));
  }

  draw() {
    const { strip, scene, bodies } = this;
    const dense = Math.min(devicePixelRatio || 1, 2);
    const rows = Math.max(bodies.length, 1);
    const tall = Math.max(22, Math.floor(40 / rows)) > 22 ? Math.max(34, rows * ROW) : rows * ROW;
    strip.style.height = `${tall + 6}px`;
    const [width, height] = [strip.clientWidth, tall + 6];
    if (!width) return;
    strip.width = Math.round(width * dense);
    strip.height = Math.round(height * dense);
    const pen = strip.getContext("2d");
    pen.scale(dense, dense);
    bodies.forEach((body, k) => this.#row(pen, body, (k * tall) / rows, tall / rows - (rows > 1 ? 1 : 0), width));
    if (!bodies.length) this.#fill(pen, 0, width, 0, tall, "#39424b");
    if (this.loaded) {
      pen.fillStyle = "#7d8a96";
      for (let k = 0; k < scene.count; k++) {
        if (this.loaded(k)) pen.fillRect((k * width) / scene.count, height - 3, Math.max(width / scene.count, 1), 3);
      }
    }
    const x = ((this.index + 0.5) * width) / scene.count;
    pen.fillStyle = "#fff";
    pen.fillRect(Math.min(Math.max(x - 1, 0), width - 2), 0, 2, height);
    this.#texts();
  }

  // One person's confidence: a column a pixel, as high as the least confident of its frames.
  #row(pen, body, top, tall, width) {
    const { count } = this.scene;
    for (let x = 0; x < width; x++) {
      const first = Math.floor((x * count) / width);
      const stop = Math.max(first + 1, Math.floor(((x + 1) * count) / width));
      let least = Infinity;
      let lost = false;
      for (let k = first; k < stop; k++) {
        if (body.rows[k] < 0) lost = true;
        else if (!(body.trust(k) >= least)) least = body.trust(k);
      }
      if (lost) this.#fill(pen, x, 1, top, tall, "#20252b");
      else if (Number.isNaN(least)) this.#fill(pen, x, 1, top, tall, "#5b6671");
      else {
        const high = Math.max(0.12, least) * tall;
        this.#fill(pen, x, 1, top, tall, "#2a3138");
        this.#fill(pen, x, 1, top + tall - high, high, this.colour(least));
      }
    }
    if (body.colour) this.#fill(pen, 0, 5, top, tall, css(body.colour));  // whose row it is
  }

  #fill(pen, x, width, top, tall, colour) {
    pen.fillStyle = colour;
    pen.fillRect(x, top, width, tall);
  }

  #texts() {
    const { scene, bodies, index, strip } = this;
    const seconds = scene.start_s + index / scene.fps;
    const trusts = bodies.map((body) => (body.rows[index] < 0 ? "no pose"
      : body.filled[body.rows[index]] ? "filled gap" : Number.isNaN(body.trust(index)) ? "" : `${Math.round(100 * body.trust(index))} %`));
    const words = `Frame ${this.frame}, ${seconds.toFixed(2)} s`;
    this.text.replaceChildren(make("b", {}, words), make("small", {}, trusts.filter(Boolean).join(" · ")));
    strip.setAttribute("aria-valuenow", this.frame);
    strip.setAttribute("aria-valuetext", `${words}, ${trusts.join(", ")}`);
    strip.title = bodies[0]?.measure ?? "";
  }
}
