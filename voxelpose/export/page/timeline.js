// Time: a steady clock, its buttons and keys, and the confidence of every frame as a strip.

import { choice, css, make } from "./elements.js";

export const SPEEDS = [0.1, 0.25, 0.5, 1, 2];
const ROW = 12;

// The frame that a clock shows: how many have passed since it was started at a frame, at a rate
// in frames per second; it begins anew after the last.
export const frameAt = (started, elapsed_ms, rate, count) =>
  Math.floor((((started + (elapsed_ms / 1000) * rate) % count) + count) % count + 1e-6) % count;

// What is typed to go to, as an index: a frame's number, or seconds as "4.2", "4 s" or "1:04"; NaN: neither.
export function typedIndex(text, { first, fps, start_s }) {
  const [, minutes, seconds, unit] = /^\s*(?:(\d+):)?(\d+(?:\.\d*)?)\s*(s?)\s*$/.exec(text) ?? [];
  if (seconds === undefined) return NaN;
  if (!minutes && !unit && !seconds.includes(".")) return Number(seconds) - first;
  return Math.round((60 * Number(minutes ?? 0) + Number(seconds) - start_s) * fps);
}

export class Timeline {
  // `shown(index)` is told whenever another frame is shown, `colour(share)` gives that of a confidence;
  // `people` tells of each body whether it is shown.
  constructor(root, scene, bodies, people, shown, colour) {
    Object.assign(this, { scene, bodies, people, shown, colour, index: 0, playing: false, speed: 1, loaded: null, loop: [0, scene.count - 1] });
    const disabled = scene.count < 2;
    const knob = (text, title, onclick, more = {}) => make("button", { title, "aria-label": title, onclick, disabled, ...more }, text);
    this.button = knob("▶", "Play (space)", () => this.toggle(), { class: "play" });
    this.whole = knob("✕", "Loop over all frames (X)", () => this.range());
    this.text = make("output", { class: "when" }, make("b"), make("small"));
    this.image = make("canvas");
    this.cursor = make("i", { class: "cursor" });
    this.strip = make("div", {
      class: "strip", tabIndex: 0, role: "slider", "aria-label": "Frame", title: bodies[0]?.measure ?? "",
      "aria-valuemin": scene.first, "aria-valuemax": scene.first + scene.count - 1,
    }, this.image, this.cursor);
    const speed = choice("Speed", SPEEDS.map((value) => [value, `${value}×`]), 1, (value) => this.faster(Number(value)));
    speed.disabled = disabled;
    this.typed = make("input", { class: "go", placeholder: "go to: 120, 4.2 s", "aria-label": "Go to a frame, or a time in seconds (G)", disabled, onchange: () => this.#go() });
    root.replaceChildren(
      make("div", { class: "knobs" }, knob("◂", "One frame back (←)", () => this.step(-1)), this.button, knob("▸", "One frame on (→)", () => this.step(1))),
      this.strip, this.text, make("div", { class: "knobs" }, this.typed,
        knob("[", "Loop from here (I)", () => this.loopFrom()), knob("]", "Loop to here (O)", () => this.loopTo()), this.whole, speed));
    this.whole.hidden = true;
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

  step(count) {
    this.toggle(false);
    this.seek(this.index + count);
  }

  // Loops from an index to another; over all without them.
  range(from = 0, to = this.scene.count - 1) {
    const last = this.scene.count - 1;
    if (from < to) this.loop = [Math.max(from, 0), Math.min(to, last)];
    this.whole.hidden = this.loop[0] === 0 && this.loop[1] === last;
    this.#startClock();
    this.shown(this.index);
    this.draw();
  }

  loopFrom() {
    this.range(this.index, this.index < this.loop[1] ? this.loop[1] : undefined);
  }

  loopTo() {
    this.range(this.index > this.loop[0] ? this.loop[0] : 0, this.index);
  }

  #go() {
    const index = typedIndex(this.typed.value, this.scene);
    const there = index >= 0 && index < this.scene.count;
    this.typed.classList.toggle("wrong", Boolean(this.typed.value) && !there);
    if (!there) return;
    this.step(index - this.index);
    this.typed.value = "";
    this.typed.blur();
  }

  toggle(on = !this.playing) {
    this.playing = on && this.scene.count > 1;
    if (this.playing && (this.index < this.loop[0] || this.index > this.loop[1])) this.seek(this.loop[0]);
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
    const [from, to] = this.loop;
    const index = from + frameAt(started - from, now - began, this.scene.fps * this.speed, to - from + 1);
    if (index === this.index) return;
    this.index = index;
    this.#show();
  }

  #startClock() {
    this.clock = { started: this.index, began: performance.now() };
  }

  #show() {
    this.shown(this.index);
    this.mark();
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
    if (this.scene.count < 2 || target.matches("select, input:not([type=checkbox])") || (event.key === " " && target.matches("button, a, input, summary"))) return;
    const second = Math.round(this.scene.fps);
    const step = event.shiftKey ? second : 1;
    const last = this.scene.count - 1;
    const moves = {
      ArrowLeft: -step, ArrowRight: step, PageUp: -second, PageDown: second, Home: -this.index, End: last - this.index,
    };
    const others = {
      " ": () => this.toggle(), g: () => this.typed.focus(), x: () => this.range(), i: () => this.loopFrom(), o: () => this.loopTo(),
    };
    if (event.key in others) others[event.key]();
    else if (event.key in moves) this.step(moves[event.key]);
    else return;
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

  // The strip, which stays as it is while frames pass.
  draw() {
    const { image, scene } = this;
    const bodies = this.bodies.filter((_, k) => this.people[k]);
    const dense = Math.min(devicePixelRatio || 1, 2);
    const most = Math.max(this.bodies.length, 1);
    const tall = most > 1 ? most * ROW : 34;
    const rows = Math.max(bodies.length, 1);
    this.strip.style.height = `${tall + 6}px`;
    const [width, height] = [this.strip.clientWidth, tall + 6];
    if (!width) return;
    image.width = Math.round(width * dense);
    image.height = Math.round(height * dense);
    const pen = image.getContext("2d");
    pen.scale(dense, dense);
    bodies.forEach((body, k) => this.#row(pen, body, (k * tall) / rows, tall / rows - (rows > 1 ? 1 : 0), width));
    if (!bodies.length) this.#fill(pen, 0, width, 0, tall, "#39424b");
    if (this.loaded) {
      pen.fillStyle = "#7d8a96";
      for (let k = 0; k < scene.count; k++) {
        if (this.loaded(k)) pen.fillRect((k * width) / scene.count, height - 3, Math.max(width / scene.count, 1), 3);
      }
    }
    const [from, stop] = [this.loop[0], this.loop[1] + 1].map((index) => (index * width) / scene.count);
    for (const [left, right] of [[0, from], [stop, width]]) this.#fill(pen, left, right - left, 0, height, "rgb(22 25 29 / 72%)");
    Object.assign(this, { width });
    this.mark();
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

  // The shown frame: in the strip, and in words.
  mark() {
    const { scene, index, strip, width = 0 } = this;
    const seconds = scene.start_s + index / scene.fps;
    const trusts = this.bodies.filter((_, k) => this.people[k]).map((body) => (body.rows[index] < 0 ? "no pose"
      : body.filled[body.rows[index]] ? "filled gap" : Number.isNaN(body.trust(index)) ? "" : `${Math.round(100 * body.trust(index))} %`));
    const words = `Frame ${this.frame}, ${seconds.toFixed(2)} s`;
    const x = Math.min(Math.max(((index + 0.5) * width) / scene.count - 1, 0), Math.max(width - 2, 0));
    this.cursor.style.transform = `translateX(${x.toFixed(1)}px)`;
    this.text.firstChild.textContent = words;
    this.text.lastChild.textContent = trusts.filter(Boolean).join(" · ");
    strip.setAttribute("aria-valuenow", this.frame);
    strip.setAttribute("aria-valuetext", `${words}, ${trusts.join(", ")}`);
  }
}
