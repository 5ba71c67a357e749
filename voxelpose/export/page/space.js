// Matrices (columns first, as WebGL has them), vectors and rotations.

export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const norm = (a) => Math.hypot(a[0], a[1], a[2]);
export const unit = (a) => scaled(a, 1 / Math.max(norm(a), 1e-12));
export const mixed = (a, b, s) => a.map((value, k) => value + (b[k] - value) * s);

export function multiply(a, b) {
  const result = new Float32Array(16);
  for (let c = 0; c < 4; c++) {
    for (let r = 0; r < 4; r++) {
      let sum = 0;
      for (let k = 0; k < 4; k++) sum += a[4 * k + r] * b[4 * c + k];
      result[4 * c + r] = sum;
    }
  }
  return result;
}

// A point in clip coordinates: x, y, z, w.
export const project = (m, p) => [0, 1, 2, 3].map((r) => m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r]);

export function perspective(fieldOfView, aspect, near, far) {
  const f = 1 / Math.tan(fieldOfView / 2);
  const depth = 1 / (near - far);
  return new Float32Array([
    f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) * depth, -1, 0, 0, 2 * far * near * depth, 0]);
}

export function lookAt(eye, target) {
  const z = unit(minus(eye, target));
  const x = unit(cross([0, 0, 1], z));
  const y = cross(z, x);
  return new Float32Array([
    x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, -dot(x, eye), -dot(y, eye), -dot(z, eye), 1]);
}

// Rotation (9, rows first) of a unit quaternion w, x, y, z.
export function rotationOf(w, x, y, z) {
  return [
    1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
    2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
    2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)];
}

export const turned = (r, p) => [
  r[0] * p[0] + r[1] * p[1] + r[2] * p[2],
  r[3] * p[0] + r[4] * p[1] + r[5] * p[2],
  r[6] * p[0] + r[7] * p[1] + r[8] * p[2]];

// A recording's camera, a pinhole: x right, y down, z forward; world rotated, then moved.
export class Pinhole {
  constructor({ name, size, matrix, rotation, translation }) {
    Object.assign(this, { name, size, matrix, rotation, translation });
    const back = [0, 3, 6, 1, 4, 7, 2, 5, 8].map((k) => rotation[k]);
    this.back = back;
    this.center = scaled(turned(back, translation), -1);
    this.forward = turned(back, [0, 0, 1]);
  }

  view() {
    const [r, t] = [this.rotation, this.translation];
    return new Float32Array([
      r[0], -r[3], -r[6], 0, r[1], -r[4], -r[7], 0, r[2], -r[5], -r[8], 0, t[0], -t[1], -t[2], 1]);
  }

  // The rectangle of the picture within a canvas, as large as fits: scale, left, top.
  fitted(width, height) {
    const scale = Math.min(width / this.size[0], height / this.size[1]);
    return [scale, (width - scale * this.size[0]) / 2, (height - scale * this.size[1]) / 2];
  }

  projection(width, height, near, far) {
    const [fx, fy, cx, cy] = this.matrix;
    const [scale, left, top] = this.fitted(width, height);
    const depth = 1 / (near - far);
    const x = (2 * (left + (cx + 0.5) * scale)) / width - 1;
    const y = 1 - (2 * (top + (cy + 0.5) * scale)) / height;
    return new Float32Array([
      (2 * scale * fx) / width, 0, 0, 0, 0, (2 * scale * fy) / height, 0, 0,
      -x, -y, (far + near) * depth, -1, 0, 0, 2 * far * near * depth, 0]);
  }

  // World points of the picture's corners at a distance along the axis: top left, top right, bottom right, bottom left.
  corners(distance) {
    const [fx, fy, cx, cy] = this.matrix;
    const [w, h] = this.size;
    return [[-0.5, -0.5], [w - 0.5, -0.5], [w - 0.5, h - 0.5], [-0.5, h - 0.5]].map(([u, v]) => add(
      this.center, turned(this.back, [((u - cx) / fx) * distance, ((v - cy) / fy) * distance, distance])));
  }
}
