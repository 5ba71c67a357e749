// Programs of the graphics card.

const LIGHT = `
  vec3 shaded(vec3 colour, vec3 normal, vec3 toEye) {
    vec3 n = normalize(normal);
    if (dot(n, toEye) < 0.0) n = -n;
    float sky = 0.5 + 0.5 * n.z;
    float key = max(dot(n, normalize(vec3(0.35, -0.45, 0.8))), 0.0);
    float front = max(dot(n, normalize(toEye)), 0.0);
    float rim = pow(1.0 - front, 3.0);
    return colour * (0.34 + 0.22 * sky + 0.34 * key + 0.22 * front) + 0.10 * rim;
  }`;

const SKIN = [`#version 300 es
  in vec3 position; in vec3 normal; in uvec4 parts; in vec4 weights; in float owner;
  uniform mat4 camera; uniform highp sampler2D places; uniform sampler2D colours;
  uniform float flatten;
  out vec3 at; out vec3 turned; out vec3 colour;
  vec4 row(uint part, int k) { return texelFetch(places, ivec2(k, int(part)), 0); }
  void main() {
    vec4 p = vec4(position, 1.0);
    vec3 q = vec3(0.0), n = vec3(0.0);
    for (int k = 0; k < 4; k++) {
      vec4 a = row(parts[k], 0), b = row(parts[k], 1), c = row(parts[k], 2);
      q += weights[k] * vec3(dot(a, p), dot(b, p), dot(c, p));
      n += weights[k] * vec3(dot(a.xyz, normal), dot(b.xyz, normal), dot(c.xyz, normal));
    }
    if (flatten > -1e5) q.z = flatten;
    at = q; turned = n;
    colour = texelFetch(colours, ivec2(0, int(owner + 0.5)), 0).rgb;
    gl_Position = camera * vec4(q, 1.0);
  }`, `#version 300 es
  precision highp float;
  in vec3 at; in vec3 turned; in vec3 colour;
  uniform vec3 eye; uniform float opacity; uniform float flatten;
  out vec4 result;
  ${LIGHT}
  void main() {
    vec3 c = flatten > -1e5 ? vec3(0.01, 0.015, 0.02) : shaded(colour, turned, normalize(eye - at));
    result = vec4(c * opacity, opacity);
  }`];

// Meshes, once or at many places: an instance has its place and its colour.
const SOLID = [`#version 300 es
  in vec3 position; in vec3 normal; in vec3 colour; in vec3 place;
  uniform mat4 camera; uniform float size;
  out vec3 at; out vec3 turned; out vec3 tint;
  void main() {
    at = place + size * position; turned = normal; tint = colour;
    gl_Position = camera * vec4(at, 1.0);
  }`, `#version 300 es
  precision highp float;
  in vec3 at; in vec3 turned; in vec3 tint;
  uniform vec3 eye; uniform float opacity;
  out vec4 result;
  ${LIGHT}
  void main() { result = vec4(shaded(tint, turned, normalize(eye - at)) * opacity, opacity); }`];

const LINES = [`#version 300 es
  in vec3 position; in vec3 colour;
  uniform mat4 camera;
  out vec3 tint;
  void main() { tint = colour; gl_Position = camera * vec4(position, 1.0); }`, `#version 300 es
  precision highp float;
  in vec3 tint;
  out vec4 result;
  void main() { result = vec4(tint, 1.0); }`];

// The floor: a grid of half metres that fades away from its middle.
const FLOOR = [`#version 300 es
  in vec3 position;
  uniform mat4 camera;
  out vec3 at;
  void main() { at = position; gl_Position = camera * vec4(position, 1.0); }`, `#version 300 es
  precision highp float;
  in vec3 at;
  uniform vec2 middle; uniform float reach;
  out vec4 result;
  float lines(float cell) {
    vec2 p = at.xy / cell, d = fwidth(p);
    vec2 near = abs(fract(p - 0.5) - 0.5) / max(d, 1e-6);
    return (1.0 - min(min(near.x, near.y), 1.0)) * clamp(0.6 - 1.4 * max(d.x, d.y), 0.0, 1.0);
  }
  void main() {
    float fade = 1.0 - smoothstep(0.25 * reach, reach, distance(at.xy, middle));
    float line = max(0.35 * lines(0.5), 0.75 * lines(1.0));
    float a = fade * (0.10 + 0.55 * line);
    result = vec4(mix(vec3(0.2, 0.235, 0.27), vec3(0.55, 0.62, 0.68), line) * a, a);
  }`];

const PICTURE = [`#version 300 es
  in vec4 position; in vec2 corner;
  uniform mat4 camera;
  out vec2 place;
  void main() { place = corner; gl_Position = camera * position; }`, `#version 300 es
  precision highp float;
  in vec2 place;
  uniform sampler2D picture; uniform float opacity;
  out vec4 result;
  void main() { result = vec4(texture(picture, place).rgb * opacity, opacity); }`];

function shader(gl, kind, text) {
  const result = gl.createShader(kind);
  gl.shaderSource(result, text);
  gl.compileShader(result);
  if (!gl.getShaderParameter(result, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(result));
  return result;
}

// A program with its attributes' and uniforms' places by their names.
function linked(gl, [vertex, fragment]) {
  const program = gl.createProgram();
  gl.attachShader(program, shader(gl, gl.VERTEX_SHADER, vertex));
  gl.attachShader(program, shader(gl, gl.FRAGMENT_SHADER, fragment));
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  const places = (count, active, place) => Object.fromEntries(Array.from({ length: gl.getProgramParameter(program, count) }, (_, k) => {
    const { name } = gl[active](program, k);
    return [name, gl[place](program, name)];
  }));
  const at = places(gl.ACTIVE_UNIFORMS, "getActiveUniform", "getUniformLocation");
  const inputs = places(gl.ACTIVE_ATTRIBUTES, "getActiveAttrib", "getAttribLocation");
  return { program, at, inputs };
}

export function programs(gl) {
  return Object.fromEntries(Object.entries({
    skin: SKIN, solid: SOLID, lines: LINES, floor: FLOOR, picture: PICTURE,
  }).map(([name, texts]) => [name, linked(gl, texts)]));
}
