// The hull of a frame: as a surface, as cubes or as dots, coloured by what each voxel tells.

import { unpacked } from "./body.js";
import { checkbox, choice, make, swatch } from "./elements.js";
import { partColour, ramp } from "./player.js";
import { BALL, CUBE } from "./renderer.js";
import { cross, minus, unit } from "./space.js";

const PLAIN = [150, 164, 178];
const UNEXPLAINED = [224, 72, 168];
const WAYS = { plain: "one colour", parts: "parts of the body", cameras: "cameras that see it", unexplained: "unexplained" };

export class Hull {
  constructor(state) {
    this.state = state;
    this.style = "surface";
    this.way = "plain";
    this.count = state.cameras.length;
  }

  controls(player) {
    const ways = Object.entries(WAYS).filter(([way]) => this.state.bodies.length || way === "plain" || way === "cameras");
    const styles = choice("Hull as", [["surface", "surface"], ["cubes", "cubes"], ["dots", "dots"]], this.style, (style) => this.set(player, { style }));
    const colours = choice("Colours of the hull", ways, this.way, (way) => this.set(player, { way }));
    return make("div", { class: "layer" }, checkbox("Hull", true, (on) => player.show("hull", on)), styles, make("span", { class: "also" }, colours));
  }

  set(player, changes) {
    Object.assign(this, changes);
    this.build(player);
    player.showLegend();
    player.redraw();
  }

  // Takes what was sent of a frame; null: there is no hull.
  take(sent, player) {
    this.sent = sent && Object.fromEntries(Object.entries(sent).map(
      ([name, value]) => [name, typeof value === "object" ? unpacked(value) : value]));
    this.size = sent?.size_m;
    this.build(player);
  }

  colour(voxel, parts) {
    const { sent } = this;
    const far = sent.far_mm[voxel] > this.state.far_mm;
    switch (this.way) {
      case "parts": return far || sent.part[voxel] < 0 ? PLAIN : partColour(sent.part[voxel], parts);
      case "cameras": return ramp(sent.cameras[voxel] / this.count);
      case "unexplained": return far ? UNEXPLAINED : PLAIN;
      default: return PLAIN;
    }
  }

  build(player) {
    const { renderer } = player;
    renderer.drop(this.mesh);
    this.mesh = null;
    if (!this.sent) return;
    const { vertices, faces, voxels, at_vertex: atVertex } = this.sent;
    const parts = this.state.bodies[0]?.parts.length ?? 0;
    const tints = new Uint8Array(voxels.length);
    for (let k = 0; k < voxels.length / 3; k++) tints.set(this.colour(k, parts), 3 * k);
    // What is next to somebody who is hidden is hidden, too.
    const hidden = (voxel) => player.people[this.sent.person[voxel]] === false;
    if (this.style !== "surface") {
      const shown = (numbers) => numbers.filter((_, k) => !hidden(Math.floor(k / 3)));
      this.mesh = renderer.crowd(this.style === "cubes" ? CUBE : BALL, shown(voxels), shown(tints));
      return;
    }
    const colours = new Uint8Array(vertices.length);
    atVertex.forEach((voxel, k) => colours.set(tints.subarray(3 * voxel, 3 * voxel + 3), 3 * k));
    const shown = player.people.includes(false) ? faces.filter((_, k) => !hidden(atVertex[faces[k - (k % 3)]])) : faces;
    this.mesh = renderer.surface(vertices, normalsOf(vertices, faces), colours, shown);
  }

  // With a body inside, the hull lets it shine through.
  draw(player) {
    if (!this.mesh) return;
    const inside = player.shown.body && player.bodies.some((_, k) => player.row(k) >= 0);
    const opacity = player.viewpoint.through ? 0.25 : inside && this.style !== "dots" ? 0.42 : 1;
    const size = { surface: 1, cubes: 0.94 * this.size, dots: 0.5 * this.size }[this.style];
    player.renderer.drawSolid(this.mesh, size, opacity);
  }
}

function normalsOf(vertices, faces) {
  const normals = new Float32Array(vertices.length);
  const at = (k) => [vertices[3 * k], vertices[3 * k + 1], vertices[3 * k + 2]];
  for (let f = 0; f < faces.length; f += 3) {
    const corners = [faces[f], faces[f + 1], faces[f + 2]];
    const [a, b, c] = corners.map(at);
    const normal = cross(minus(b, a), minus(c, a));
    for (const corner of corners) for (let k = 0; k < 3; k++) normals[3 * corner + k] += normal[k];
  }
  for (let k = 0; k < normals.length; k += 3) normals.set(unit([normals[k], normals[k + 1], normals[k + 2]]), k);
  return normals;
}

export function hullLegend(hull, player, state) {
  const plain = swatch([PLAIN], "hull: where all silhouettes allow a body");
  switch (hull.way) {
    case "parts": {
      const parts = state.bodies[0].parts;
      const few = [...parts.keys()].map((part) => partColour(part, parts.length));
      return [swatch(few.slice(0, 7), "hull: the part of the body next to each voxel, a colour each"),
        swatch([PLAIN], `no part within ${state.far_mm / 10} cm`)];
    }
    case "cameras": return [swatch([0, 0.5, 1].map(ramp), `hull: how many of ${hull.count} cameras see it, none to all`)];
    case "unexplained": return [plain, swatch([UNEXPLAINED], `no part within ${state.far_mm / 10} cm: a bag, a shadow, a lost limb, or room that the cameras cannot see into`)];
    default: return [plain];
  }
}

