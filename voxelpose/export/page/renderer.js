// Draws a scene with WebGL: what is opaque first, then what shines through, the skeleton last.

import { programs } from "./shaders.js";
import { add, cross, dot, minus, scaled, unit } from "./space.js";

const NOT_FLAT = -1e6;
const NEAR = 0.1;  // part of the depth that is kept for what is drawn over all else
const QUICK = 4e5;  // pixels of a picture while it moves, where there is no graphics card
const CELL = 0.5;  // of the floor's grid, m
const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i;
const KINDS = { Float32Array: "FLOAT", Int8Array: "BYTE", Uint8Array: "UNSIGNED_BYTE", Uint16Array: "UNSIGNED_SHORT", Uint32Array: "UNSIGNED_INT" };
const IDENTITY = new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);

// A cube and an octahedron around the origin, one unit wide: positions and normals.
export const CUBE = solid([[[1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 0], [0, 0, 1], [1, 0, 0]], [[0, 0, 1], [1, 0, 0], [0, 1, 0]]]
  .flatMap(([n, u, v]) => [1, -1].flatMap((side) => {
    const corner = (a, b) => add(add(scaled(n, side / 2), scaled(u, a / 2)), scaled(v, b / 2));
    const quad = [corner(-1, -side), corner(1, -side), corner(1, side), corner(-1, side)];
    return [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]];
  })));
export const BALL = solid([1, -1].flatMap((x) => [1, -1].flatMap((y) => [1, -1].map((z) => {
  const face = [[x / 2, 0, 0], [0, y / 2, 0], [0, 0, z / 2]];
  return x * y * z > 0 ? face : [face[0], face[2], face[1]];
}))), true);

function solid(faces, round = false) {
  const positions = faces.flat(2);
  const normals = faces.flatMap((face) => {
    const flat = unit(cross(minus(face[1], face[0]), minus(face[2], face[0])));
    return face.flatMap((corner) => (round ? unit(corner) : flat));
  });
  return { positions: new Float32Array(positions), normals: new Float32Array(normals) };
}

// Whether the corners of a body's faces go anticlockwise, seen from outside: its volume is positive.
function isOutward({ faces, vertices }) {
  let volume = 0;
  for (let k = 0; k < faces.length; k += 3) {
    const [a, b, c] = [0, 1, 2].map((n) => vertices.subarray(3 * faces[k + n], 3 * faces[k + n] + 3));
    volume += dot(a, cross(b, c));
  }
  return volume > 0;
}

// Triangles of a line of the skeleton: two pyramids, thickest near the start.
export function boneFaces(start, end, width, faces, normals) {
  const along = minus(end, start);
  const axis = unit(along);
  const side = unit(cross(axis, Math.abs(axis[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]));
  const other = cross(axis, side);
  const thick = add(start, scaled(along, 0.18));
  const ring = [0, 1, 2, 3, 4, 5].map((k) => {
    const angle = (k * Math.PI) / 3;
    return add(thick, add(scaled(side, width * Math.cos(angle)), scaled(other, width * Math.sin(angle))));
  });
  for (let k = 0; k < 6; k++) {
    const [a, b] = [ring[k], ring[(k + 1) % 6]];
    for (const face of [[start, b, a], [end, a, b]]) {
      const normal = unit(cross(minus(face[1], face[0]), minus(face[2], face[0])));
      for (const corner of face) {
        faces.push(...corner);
        normals.push(...normal);
      }
    }
  }
}

// Triangles of the mark of a joint.
export function jointFaces(point, size, faces, normals) {
  for (let k = 0; k < BALL.positions.length; k++) faces.push(point[k % 3] + size * BALL.positions[k]);
  normals.push(...BALL.normals);
}

export class Renderer {
  constructor(canvas) {
    // Edges are smooth since more pixels are drawn than shown: multisampling takes most of the time
    // where there is no graphics card.
    const gl = canvas.getContext("webgl2", { antialias: false, alpha: false });
    if (!gl) throw new Error("this browser draws nothing in three dimensions: it has no WebGL 2");
    const named = gl.getExtension("WEBGL_debug_renderer_info");
    const slow = SOFTWARE.test(gl.getParameter(named ? named.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
    Object.assign(this, { canvas, gl, slow, programs: programs(gl), background: [0.118, 0.137, 0.16] });
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    this.screen = this.mesh("picture", { position: [new Float32Array(16), 4], corner: [new Float32Array([0, 0, 1, 0, 1, 1, 0, 1]), 2] });
  }

  // Begins a picture of the canvas; `camera` takes the world to clip coordinates. `fine`: with smooth
  // edges, else with as many pixels as a processor draws in time.
  begin(camera, eye, fine) {
    const { canvas, gl } = this;
    const { clientWidth: width, clientHeight: height } = canvas;
    const dense = fine ? 2 : Math.min(1, Math.sqrt(QUICK / Math.max(width * height, 1)));
    const size = [width, height].map((side) => Math.max(1, Math.round(side * dense)));
    if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;
    gl.viewport(0, 0, ...size);
    gl.clearColor(...this.background, 1);
    gl.depthMask(true);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.depthRange(NEAR, 1);
    gl.enable(gl.DEPTH_TEST);
    Object.assign(this, { camera, eye, fine });
  }

  buffer(data, target = this.gl.ARRAY_BUFFER) {
    const made = this.gl.createBuffer();
    this.gl.bindBuffer(target, made);
    this.gl.bufferData(target, data, this.gl.STATIC_DRAW);
    return made;
  }

  // What is drawn in one call. Inputs by name: array, numbers of each, and how it is read.
  mesh(program, inputs, faces = null, count = 0, instances = 0) {
    const { gl } = this;
    const array = gl.createVertexArray();
    const buffers = [];
    gl.bindVertexArray(array);
    for (const [name, [data, numbers, { share = false, each = 0 } = {}]] of Object.entries(inputs)) {
      const at = this.programs[program].inputs[name];
      buffers.push(this.buffer(data));
      gl.enableVertexAttribArray(at);
      gl.vertexAttribPointer(at, numbers, this.#kind(data), share, 0, 0);
      gl.vertexAttribDivisor(at, each);
    }
    if (faces) buffers.push(this.buffer(faces, gl.ELEMENT_ARRAY_BUFFER));
    gl.bindVertexArray(null);
    return { array, buffers, faces: faces ? this.#kind(faces) : 0, count: faces ? faces.length : count, instances };
  }

  #kind(data) {
    return this.gl[KINDS[data.constructor.name]];
  }

  drop(mesh) {
    if (!mesh) return;
    this.gl.deleteVertexArray(mesh.array);
    for (const buffer of mesh.buffers) this.gl.deleteBuffer(buffer);
  }

  // Triangles with a colour at every corner.
  surface(positions, normals, colours, faces = null) {
    return this.mesh("solid", {
      position: [positions, 3], normal: [normals, 3], colour: [colours, 3, { share: true }],
    }, faces, positions.length / 3);
  }

  // One shape at many places.
  crowd(shape, places, colours) {
    return this.mesh("solid", {
      position: [shape.positions, 3], normal: [shape.normals, 3],
      place: [places, 3, { each: 1 }], colour: [colours, 3, { share: true, each: 1 }],
    }, null, places.length ? shape.positions.length / 3 : 0, places.length / 3);
  }

  // Balls of one colour.
  balls(places, colour) {
    return this.crowd(BALL, places, new Uint8Array(places.length).map((_, k) => colour[k % 3]));
  }

  lines(positions, colours) {
    return this.mesh("lines", { position: [positions, 3], colour: [colours, 4, { share: true }] }, null, positions.length / 3);
  }

  // The surface of a body, which `place` bends.
  skin(body) {
    const { gl } = this;
    const [positions, normals] = [new Float32Array(body.vertices.length), new Float32Array(body.vertices.length)];
    const colours = new Uint8Array(body.vertices.length);
    const mesh = this.surface(positions, normals, colours, body.faces);
    mesh.outside = isOutward(body) ? gl.CCW : gl.CW;
    return { body, positions, normals, colours, mesh };
  }

  texture() {
    const { gl } = this;
    const made = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, made);
    for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
    for (const way of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, way, gl.LINEAR);
    return made;
  }

  // Bends a skin: where its parts are, 12 numbers each, and their colours, 3 bytes each. Once for all
  // that is drawn of it, which the graphics card would do for every use of a vertex.
  place(skin, places, partColours) {
    const { gl } = this;
    const { positions, normals, colours, mesh } = skin;
    const { vertices, normals: rest, skin_parts: parts, skin_weights: weights, owner } = skin.body;
    const m = new Float32Array(12);
    for (let v = 0; v < owner.length; v++) {
      m.fill(0);
      for (let k = 4 * v; k < 4 * v + 4; k++) {
        if (!weights[k]) continue;
        const [share, from] = [weights[k] / 255, 12 * parts[k]];
        for (let n = 0; n < 12; n++) m[n] += share * places[from + n];
      }
      const [at, from] = [3 * v, 3 * owner[v]];
      const [x, y, z, nx, ny, nz] = [vertices[at], vertices[at + 1], vertices[at + 2], rest[at], rest[at + 1], rest[at + 2]];
      for (let n = 0; n < 3; n++) {
        const [a, b, c, d] = [m[4 * n], m[4 * n + 1], m[4 * n + 2], m[4 * n + 3]];
        positions[at + n] = a * x + b * y + c * z + d;
        normals[at + n] = a * nx + b * ny + c * nz;
        colours[at + n] = partColours[from + n];
      }
    }
    [positions, normals, colours].forEach((data, k) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, mesh.buffers[k]);
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, data);
    });
  }

  picture(texture, image) {
    const { gl } = this;
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, gl.RGB, gl.UNSIGNED_BYTE, image);
  }

  // A shadow below, of one colour: it is not drawn twice where triangles lie over each other.
  drawShadow(mesh, floor) {
    this.#draw(mesh, this.#solid(1, floor), 1);
  }

  drawSolid(mesh, size = 1, opacity = 1) {
    const at = this.#solid(size);
    this.#through(opacity, () => this.#draw(mesh, at, opacity));
  }

  #solid(size, flatten = NOT_FLAT) {
    const at = this.#use("solid");
    this.gl.uniform1f(at.size, size);
    this.gl.uniform1f(at.flatten, flatten);
    this.gl.vertexAttrib3f(this.programs.solid.inputs.place, 0, 0, 0);
    return at;
  }

  drawLines(mesh) {
    const { gl } = this;
    this.#use("lines");
    gl.bindVertexArray(mesh.array);
    this.#blend(true);
    gl.drawArrays(gl.LINES, 0, mesh.count);
    this.#blend(false);
  }

  // The floor: a grid of half metres that fades away from its middle.
  drawFloor(middle, height, reach) {
    const key = [...middle, height, reach].join();
    if (this.floorKey !== key) {
      this.floorKey = key;
      this.drop(this.floor);
      this.floor = this.#grid(middle, height, reach);
    }
    this.drawLines(this.floor);
  }

  #grid([x, y], height, reach) {
    const [ends, colours] = [[], []];
    const least = (center) => Math.ceil((center - reach) / CELL);
    for (const [across, along, turn] of [[x, y, false], [y, x, true]]) {
      for (let line = least(across); line * CELL < across + reach; line++) {
        for (let k = 4 * Math.floor(least(along) / 4); k * CELL < along + reach; k += 4) {
          for (const end of [k, k + 4]) {
            const [a, b] = [line * CELL, end * CELL];
            const far = Math.min(Math.max((Math.hypot(a - across, b - along) / reach - 0.2) / 0.8, 0), 1);
            ends.push(...(turn ? [b, a] : [a, b]), height);
            colours.push(140, 158, 173, (line % 2 ? 80 : 140) * (1 - far) ** 2);
          }
        }
      }
    }
    return this.lines(new Float32Array(ends), new Uint8Array(colours));
  }

  // A picture between four corners in the world, or over a rectangle of the canvas in clip coordinates.
  drawPicture(texture, corners, opacity = 1, flat = false) {
    const { gl } = this;
    const at = this.#use("picture", flat ? IDENTITY : this.camera);
    gl.uniform1f(at.opacity, opacity);
    gl.uniform1i(at.picture, 0);
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.bindVertexArray(this.screen.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.screen.buffers[0]);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(corners.flatMap((p) => [...p, 1])), gl.DYNAMIC_DRAW);
    if (flat) gl.disable(gl.DEPTH_TEST);
    this.#blend(opacity < 1);
    gl.drawArrays(gl.TRIANGLE_FAN, 0, 4);
    this.#blend(false);
    gl.enable(gl.DEPTH_TEST);
  }

  // What follows is drawn over all that is there.
  over() {
    this.gl.depthRange(0, NEAR);
  }

  // The nearest surface of what shines through, and not what lies behind it: depth first, then colour.
  #through(opacity, draw) {
    const { gl } = this;
    if (opacity >= 1) {
      draw();
      return;
    }
    gl.colorMask(false, false, false, false);
    draw();
    gl.colorMask(true, true, true, true);
    gl.depthFunc(gl.LEQUAL);
    this.#blend(true);
    draw();
    this.#blend(false);
    gl.depthFunc(gl.LESS);
  }

  // Begins to draw with a program; returns the places of what it is given.
  #use(name, camera = this.camera) {
    const { program, at } = this.programs[name];
    this.gl.useProgram(program);
    this.gl.uniformMatrix4fv(at.camera, false, camera);
    return at;
  }

  #blend(on) {
    if (on) this.gl.enable(this.gl.BLEND);
    else this.gl.disable(this.gl.BLEND);
  }

  #draw(mesh, at, opacity) {
    const { gl } = this;
    gl.uniform3f(at.eye, ...this.eye);
    gl.uniform1f(at.opacity, opacity);
    gl.bindVertexArray(mesh.array);
    // Of a body that moves, what faces away is left out: without a graphics card every triangle counts.
    if (mesh.outside && !this.fine) gl.enable(gl.CULL_FACE);
    else gl.disable(gl.CULL_FACE);
    gl.frontFace(mesh.outside ?? gl.CCW);
    if (mesh.instances) gl.drawArraysInstanced(gl.TRIANGLES, 0, mesh.count, mesh.instances);
    else if (mesh.faces) gl.drawElements(gl.TRIANGLES, mesh.count, mesh.faces, 0);
    else gl.drawArrays(gl.TRIANGLES, 0, mesh.count);
  }
}
