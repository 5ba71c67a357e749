// Bodies as they were sent: arrays unpacked, and parts and joints placed in any frame.

import { add, minus, rotationOf, turned } from "./space.js";

const TYPES = {
  float32: Float32Array, int32: Int32Array, int16: Int16Array, int8: Int8Array,
  uint32: Uint32Array, uint16: Uint16Array, uint8: Uint8Array,
};

// An array that was sent as its type and its bytes in base64.
export function unpacked(sent) {
  if (!sent) return null;
  const bytes = Uint8Array.from(atob(sent.data), (letter) => letter.charCodeAt(0));
  return new TYPES[sent.type](bytes.buffer);
}

const ARRAYS = [
  "joints", "vertices", "normals", "faces", "owner", "skin_parts", "skin_weights", "rows", "filled", "root",
  "turn", "points_part", "points", "bones", "overlap", "confidence"];

export class Body {
  constructor(sent) {
    Object.assign(this, sent);
    for (const name of ARRAYS) this[name] = unpacked(sent[name]);
    this.count = this.parts.length;
    this.order = [...this.parts.keys()];  // parents come before their children
    this.places = new Float32Array(12 * this.count);
  }

  // Share of a part inside the hull in a row, from 0 to 1; NaN where it is not known.
  inside(row, part) {
    const value = this.overlap && row >= 0 ? this.overlap[row * this.count + part] : 255;
    return value === 255 ? NaN : value / 250;
  }

  // How far a frame's pose can be trusted, from 0 to 1; NaN: no pose, or nobody knows.
  trust(index) {
    const row = this.rows[index];
    const value = this.confidence && row >= 0 ? this.confidence[row] : 255;
    return value === 255 ? NaN : value / 250;
  }

  // Places the parts of a row: rotations and origins by part, and `places`, three rows of four
  // numbers by part that take a point at rest into the world, moved by an offset.
  place(row, offset = [0, 0, 0]) {
    const { count, turn, joints, parents, places } = this;
    const rotations = [];
    const origins = [];
    for (const part of this.order) {
      const at = 4 * (row * count + part);
      const [w, x, y, z] = [0, 1, 2, 3].map((k) => turn[at + k] / 32767);
      const size = Math.hypot(w, x, y, z);
      rotations[part] = rotationOf(w / size, x / size, y / size, z / size);
      const joint = this.joint(part);
      const parent = parents[part];
      origins[part] = parent < 0
        ? [0, 1, 2].map((k) => this.root[3 * row + k] + offset[k])
        : add(origins[parent], turned(rotations[parent], minus(joint, this.joint(parent))));
      const rest = turned(rotations[part], joint);
      for (let k = 0; k < 3; k++) {
        places.set(rotations[part].slice(3 * k, 3 * k + 3), 12 * part + 4 * k);
        places[12 * part + 4 * k + 3] = origins[part][k] - rest[k];
      }
    }
    Object.assign(this, { rotations, origins });
    return joints && places;
  }

  joint(part) {
    return [this.joints[3 * part], this.joints[3 * part + 1], this.joints[3 * part + 2]];
  }

  // The points of the skeleton in the world, of the row that was placed last.
  skeleton() {
    return Array.from(this.points_part, (part, k) => add(
      this.origins[part], turned(this.rotations[part], this.points.slice(3 * k, 3 * k + 3))));
  }

  // The part whose movement a line of the skeleton shows.
  partOf(bone) {
    const [start, end] = [this.bones[2 * bone], this.bones[2 * bone + 1]];
    return end < this.count ? this.points_part[end] : this.points_part[start];
  }
}
