// From where the scene is seen: around a point, by dragging, or through one of the cameras.

import { add, cross, lookAt, minus, mixed, multiply, norm, perspective, project, scaled, unit } from "./space.js";

const FIELD_OF_VIEW = 0.8;
const FLIGHT_MS = 450;
const smooth = (s) => s * s * (3 - 2 * s);

export class Viewpoint {
  // `changed()` asks for a new picture, `left()` tells that a camera is not looked through any more.
  constructor(canvas, { look_at, eye }, changed, left) {
    // Home is as far from the middle of what is followed as the scene was seen from at first.
    Object.assign(this, { canvas, target: look_at, eye, center: look_at, home: minus(eye, look_at), changed, left });
    this.pinhole = null;
    this.pointers = new Map();
    this.#listen();
  }

  // The matrix from the world to clip coordinates, as of a time in ms.
  matrix(now) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (this.flight) this.#fly(now);
    if (this.through) return multiply(this.pinhole.projection(width, height, 0.05, 200), this.pinhole.view());
    const far = 200 + 4 * norm(minus(this.eye, this.target));
    return multiply(perspective(this.field, width / Math.max(height, 1), 0.05, far), lookAt(this.eye, this.target));
  }

  // What is high and narrow needs the field of view along its width.
  get field() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return 2 * Math.atan(Math.tan(FIELD_OF_VIEW / 2) * Math.max(1, Math.min(height / Math.max(width, 1), 1.35)));
  }

  // The camera that is looked through, once it is reached.
  get through() {
    return this.flight ? null : this.pinhole;
  }

  get eyeNow() {
    return this.through?.center ?? this.eye;
  }

  // Flies to the place of a camera, and looks through it.
  flyTo(pinhole) {
    const away = Math.max(norm(minus(pinhole.center, this.target)), 0.5);
    this.#start(pinhole.center, add(pinhole.center, scaled(pinhole.forward, away)));
    this.pinhole = pinhole;
  }

  // Goes back to where the scene was seen from at first.
  goHome() {
    this.#leave();
    this.#start(add(this.center, this.home), this.center);
  }

  // Shows a ball in space as large as it fits, from the same side.
  fit(middle, radius) {
    this.#leave();
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const half = Math.atan(Math.tan(this.field / 2) * Math.min(1, width / Math.max(height, 1)));
    this.#start(add(middle, scaled(unit(minus(this.eye, this.target)), radius / Math.sin(half))), middle);
  }

  // Moves along with a point, without taking back what was turned, panned and zoomed.
  follow(point) {
    const step = minus(point, this.center);
    this.center = point;
    if (this.pinhole) return;
    this.target = add(this.target, step);
    this.eye = add(this.eye, step);
    if (this.flight) for (const ends of [this.flight.from, this.flight.to]) ends.forEach((end, k) => (ends[k] = add(end, step)));
  }

  // Where a point of the world is in the canvas, in its pixels; null: behind the viewer.
  pixel(matrix, point) {
    const [x, y, , w] = project(matrix, point);
    if (w < 0.05) return null;
    return [(0.5 + x / w / 2) * this.canvas.clientWidth, (0.5 - y / w / 2) * this.canvas.clientHeight];
  }

  #start(eye, target) {
    this.flight = { from: [this.eye, this.target], to: [eye, target], began: performance.now() };
    this.changed();
  }

  #fly(now) {
    const { from, to, began } = this.flight;
    const s = smooth(Math.min(Math.max((now - began) / FLIGHT_MS, 0), 1));
    this.eye = mixed(from[0], to[0], s);
    this.target = mixed(from[1], to[1], s);
    if (s >= 1) this.flight = null;
    this.changed();
  }

  #leave() {
    this.flight = null;
    if (!this.pinhole) return;
    this.pinhole = null;
    this.left();
  }

  turn(right, up) {
    this.#leave();
    const from = minus(this.eye, this.target);
    const away = norm(from);
    const around = Math.atan2(from[1], from[0]) - right;
    const height = Math.min(Math.max(Math.asin(from[2] / away) + up, -1.5), 1.5);
    this.eye = add(this.target, scaled([Math.cos(height) * Math.cos(around), Math.cos(height) * Math.sin(around), Math.sin(height)], away));
    this.changed();
  }

  pan(right, up) {
    this.#leave();
    const back = minus(this.eye, this.target);
    const side = unit(cross([0, 0, 1], back));
    const over = unit(cross(back, side));
    const size = (2 * Math.tan(FIELD_OF_VIEW / 2) * norm(back)) / this.canvas.clientHeight;
    const step = add(scaled(side, -right * size), scaled(over, up * size));
    this.eye = add(this.eye, step);
    this.target = add(this.target, step);
    this.changed();
  }

  zoom(factor) {
    this.#leave();
    const back = minus(this.eye, this.target);
    const away = Math.min(Math.max(norm(back) * factor, 0.2), 100);
    this.eye = add(this.target, scaled(unit(back), away));
    this.changed();
  }

  #listen() {
    const { canvas, pointers } = this;
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(Math.min(Math.max(event.deltaY, -100), 100) * 0.0015));
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      this.moved = 0;
    });
    const over = (event) => pointers.delete(event.pointerId);
    canvas.addEventListener("pointerup", over);
    canvas.addEventListener("pointercancel", over);
    canvas.addEventListener("pointermove", (event) => {
      const before = pointers.get(event.pointerId);
      if (!before) return;
      const here = [event.clientX, event.clientY];
      const [x, y] = [here[0] - before[0], here[1] - before[1]];
      this.moved += Math.abs(x) + Math.abs(y);
      if (this.moved < 4) return;  // a click
      const other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
      if (other) {  // two fingers
        const gap = (point) => Math.hypot(point[0] - other[0], point[1] - other[1]);
        this.zoom(gap(before) / Math.max(gap(here), 1));
        this.pan(x / 2, y / 2);
      } else if (event.buttons & 6 || event.shiftKey) this.pan(x, y);
      else this.turn(x * 0.007, y * 0.007);
      pointers.set(event.pointerId, here);
    });
  }
}
