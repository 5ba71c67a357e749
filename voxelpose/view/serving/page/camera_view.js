// One camera: its picture and all that is laid over it, zoomed and panned.

import { button, make } from "./elements.js";

const COLOURS = {
  region: "#50c878", unknown: "#ff9628", point: "#ffd23f", expected: "#ff6ec7",
  x: "#ff5a4d", y: "#5fd068", z: "#5a9bff", grid: "rgb(255 255 255 / 42%)",
  middle: "rgb(255 255 255 / 80%)", pole: "#ffd23f",
};
const MOST_ZOOM = 64;
const OVERLAID = ["first", "silhouette", "body"]; // stages over the picture, others instead of it

export class CameraView {
  constructor(camera) {
    this.camera = camera;
    this.name = camera.name;
    [this.width, this.height] = camera.size;
    this.canvas = make("canvas", { tabIndex: 0, role: "button", "aria-label": `Enlarge ${camera.name}` });
    this.element = make("div", { class: "tile", "data-camera": camera.name }, this.canvas,
      make("div", { class: "name" }, camera.name, make("small", {}, camera.size.join(" × "))), buttons(this));
    this.zoom = 1; // over what fits
    this.middle = [0.5, 0.5]; // of the picture, in the middle of the canvas
    this.image = this.silhouette = this.staged = this.painted = this.hidden = null;
    this.ground = [];
    this.large = false;
    new ResizeObserver(() => this.draw()).observe(this.element);
  }

  get scale() {
    return this.fitted * this.zoom;
  }

  // Size in pixels of the page, and how the picture fits into it.
  measure() {
    const box = this.element.getBoundingClientRect();
    this.box = [Math.max(1, box.width - 2), Math.max(1, box.height - 2)];
    this.fitted = Math.min(this.box[0] / this.width, this.box[1] / this.height);
  }

  // Canvas position of a pixel (whole numbers are centres of pixels), and back.
  toCanvas([x, y]) {
    return [
      this.box[0] / 2 + (x + 0.5 - this.middle[0] * this.width) * this.scale,
      this.box[1] / 2 + (y + 0.5 - this.middle[1] * this.height) * this.scale,
    ];
  }

  toPixel([x, y]) {
    return [
      (x - this.box[0] / 2) / this.scale + this.middle[0] * this.width - 0.5,
      (y - this.box[1] / 2) / this.scale + this.middle[1] * this.height - 0.5,
    ];
  }

  contains([x, y]) {
    return x >= -0.5 && y >= -0.5 && x <= this.width - 0.5 && y <= this.height - 0.5;
  }

  // A point of the picture, to a tenth of a pixel, within it.
  within([x, y]) {
    const bound = (value, size) => Math.round(Math.min(Math.max(value, 0), size - 1) * 10) / 10;
    return [bound(x, this.width), bound(y, this.height)];
  }

  zoomAt(position, factor) {
    this.measure();
    const before = this.toPixel(position);
    this.zoom = Math.min(Math.max(this.zoom * factor, 1), MOST_ZOOM / Math.min(this.fitted, 1));
    const after = this.toPixel(position);
    this.middle[0] += (before[0] - after[0]) / this.width;
    this.middle[1] += (before[1] - after[1]) / this.height;
    this.bound();
  }

  pan(dx, dy) {
    this.middle[0] -= dx / this.scale / this.width;
    this.middle[1] -= dy / this.scale / this.height;
    this.bound();
  }

  bound() {
    if (this.zoom <= 1) this.middle = [0.5, 0.5];
    this.middle = this.middle.map((value) => Math.min(Math.max(value, 0), 1));
    this.draw();
  }

  reset() {
    this.zoom = 1;
    this.bound();
  }

  draw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.paint();
    });
  }

  paint() {
    if (!this.element.isConnected || !this.scene) return;
    this.measure();
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = this.box.map((value) => Math.round(value * ratio));
    if (this.canvas.width !== width || this.canvas.height !== height) {
      Object.assign(this.canvas, { width, height });
    }
    const pen = this.canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, ...this.box);
    pen.imageSmoothingEnabled = this.scale < 3;
    const scene = this.scene(this.name);
    const staged = this.staged?.stage === scene.stage ? this.staged.image : null;
    const over = OVERLAID.includes(scene.stage);
    this.layer(pen, over ? this.image : staged ?? this.image);
    if (over) this.layer(pen, scene.stage === "silhouette" ? this.silhouette ?? staged : staged);
    this.layer(pen, this.hidden);
    if (scene.region.polygons.length || (scene.region.painted && this.painted)) {
      this.layer(pen, this.outside(scene.region));
    }
    pen.lineJoin = "round";
    if (scene.ground) this.floor(pen);
    this.polygons(pen, scene.unknown, "unknown", scene);
    this.polygons(pen, scene.region.polygons, "region", scene);
    if (scene.draft) this.draft(pen, scene.draft);
    this.points(pen, scene);
  }

  layer(pen, image) {
    if (!image) return;
    const [x, y] = this.toCanvas([-0.5, -0.5]);
    pen.drawImage(image, x, y, this.width * this.scale, this.height * this.scale);
  }

  // What is outside of the region, darkened; kept while the region stays the same.
  outside(region) {
    const key = JSON.stringify(region) + Boolean(this.painted);
    if (this.outsideKey === key) return this.outsideLayer;
    const layer = new OffscreenCanvas(this.width, this.height);
    const pen = layer.getContext("2d");
    pen.fillStyle = "rgb(6 10 8 / 62%)";
    pen.fillRect(0, 0, this.width, this.height);
    pen.globalCompositeOperation = "destination-out";
    pen.fillStyle = "#000";
    if (region.painted && this.painted) pen.drawImage(this.painted, 0, 0);
    for (const polygon of region.polygons) {
      pen.beginPath();
      for (const [x, y] of polygon) pen.lineTo(x + 0.5, y + 0.5);
      pen.fill("evenodd");
    }
    this.outsideKey = key;
    this.outsideLayer = layer;
    return layer;
  }

  path(pen, pixels, closed) {
    pen.beginPath();
    for (const pixel of pixels) pen.lineTo(...this.toCanvas(pixel));
    if (closed) pen.closePath();
  }

  // The floor's lines within the picture.
  floor(pen) {
    const [x, y] = this.toCanvas([-0.5, -0.5]);
    pen.save();
    pen.beginPath();
    pen.rect(x, y, this.width * this.scale, this.height * this.scale);
    pen.clip();
    for (const line of this.ground) this.line(pen, line);
    pen.restore();
  }

  line(pen, { kind, pixels }) {
    this.path(pen, pixels, false);
    pen.strokeStyle = COLOURS[kind];
    pen.lineWidth = { grid: 1, middle: 1.5, pole: 3 }[kind] || 3;
    pen.stroke();
    if (!"xyz".includes(kind) || !this.large) return;
    const [x, y] = this.toCanvas(pixels.at(-1));
    pen.fillStyle = COLOURS[kind];
    pen.font = "600 13px system-ui, sans-serif";
    pen.fillText(kind, x + 5, y - 4);
  }

  polygons(pen, polygons, kind, scene) {
    polygons.forEach((polygon, index) => {
      const chosen = scene.chosen && scene.chosen.kind === kind && scene.chosen.index === index;
      this.path(pen, polygon, true);
      if (kind === "unknown") {
        pen.fillStyle = hatch(pen);
        pen.fill("evenodd");
      }
      pen.strokeStyle = COLOURS[kind];
      pen.lineWidth = chosen ? 3 : 2;
      pen.stroke();
      if (!this.large || scene.tool !== kind) return;
      polygon.forEach((corner, number) => {
        this.handle(pen, corner, COLOURS[kind], chosen && scene.chosen.corner === number ? 7 : 5);
        const next = polygon[(number + 1) % polygon.length];
        if (chosen) this.handle(pen, middleOf(corner, next), COLOURS[kind], 3);
      });
    });
  }

  draft(pen, { kind, corners, cursor }) {
    this.path(pen, cursor ? [...corners, cursor] : corners, false);
    pen.strokeStyle = COLOURS[kind];
    pen.lineWidth = 2;
    pen.setLineDash([6, 4]);
    pen.stroke();
    pen.setLineDash([]);
    corners.forEach((corner, number) => this.handle(pen, corner, COLOURS[kind], number ? 4 : 7));
  }

  handle(pen, pixel, colour, radius) {
    pen.beginPath();
    pen.arc(...this.toCanvas(pixel), radius, 0, 2 * Math.PI);
    pen.fillStyle = "#10151a";
    pen.fill();
    pen.strokeStyle = colour;
    pen.lineWidth = 2;
    pen.stroke();
  }

  points(pen, scene) {
    for (const point of scene.points) {
      const expected = scene.errors?.[point.name]?.pixels[this.name]?.expected;
      const pixel = point.pixels[this.name];
      const chosen = scene.tool === "points" && scene.point === point.name;
      if (expected && (pixel || (scene.tool === "points" && this.contains(expected)))) {
        this.cross(pen, expected, COLOURS.expected, 5, Math.PI / 4, 1.5);
        if (pixel) {
          this.path(pen, [pixel, expected], false);
          pen.stroke();
        }
      }
      if (!pixel) continue;
      this.cross(pen, pixel, COLOURS.point, chosen ? 11 : 7, 0, chosen ? 2 : 1.5);
      const [x, y] = this.toCanvas(pixel);
      if (chosen) {
        pen.beginPath();
        pen.arc(x, y, 8, 0, 2 * Math.PI);
        pen.stroke();
      }
      if (!this.large && !chosen) continue;
      pen.font = `${chosen ? 600 : 400} 12px system-ui, sans-serif`;
      pen.lineWidth = 3;
      pen.strokeStyle = "rgb(0 0 0 / 75%)";
      pen.strokeText(point.name, x + 11, y - 8);
      pen.fillStyle = COLOURS.point;
      pen.fillText(point.name, x + 11, y - 8);
    }
  }

  cross(pen, pixel, colour, radius, turn, width) {
    const [x, y] = this.toCanvas(pixel);
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.beginPath();
    for (const angle of [turn, turn + Math.PI / 2]) {
      const [dx, dy] = [radius * Math.cos(angle), radius * Math.sin(angle)];
      pen.moveTo(x - dx, y - dy);
      pen.lineTo(x + dx, y + dy);
    }
    pen.stroke();
  }
}

export const middleOf = ([a, b], [c, d]) => [(a + c) / 2, (b + d) / 2];

let hatching = null;

function hatch(pen) {
  if (hatching) return hatching;
  const tile = new OffscreenCanvas(9, 9);
  const brush = tile.getContext("2d");
  brush.fillStyle = "rgb(255 150 40 / 16%)";
  brush.fillRect(0, 0, 9, 9);
  brush.strokeStyle = "rgb(255 150 40 / 75%)";
  brush.lineWidth = 1.6;
  brush.beginPath();
  for (const shift of [-9, 0, 9]) {
    brush.moveTo(shift - 1, 10);
    brush.lineTo(shift + 10, -1);
  }
  brush.stroke();
  hatching = pen.createPattern(tile, "repeat");
  return hatching;
}

function buttons(view) {
  return make("div", { class: "buttons" }, ...[
    ["Whole picture", "Zoom out until all of it is seen (0)", "whole"],
    ["All cameras", "Back to all cameras (Esc)", "all"],
  ].map(([text, title, event]) => button(text, (click) => {
    click.stopPropagation();
    view.element.dispatchEvent(new CustomEvent(event));
  }, { title })));
}
