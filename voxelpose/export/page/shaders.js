// Programs of the graphics card.

const LIGHT = `
  vec3 shaded(vec3 colour, vec3 normal, vec3 toEye) {
    float facing = dot(normal, toEye);
    vec3 n = normal * (sign(facing) * inversesqrt(dot(normal, normal)));
    float key = max(dot(n, vec3(0.356, -0.458, 0.814)), 0.0);
    float front = dot(n, toEye);
    float edge = 1.0 - front;
    return colour * (0.45 + 0.11 * n.z + 0.34 * key + 0.22 * front) + 0.10 * edge * edge * edge;
  }`;

const TINTED = `#version 300 es
  precision mediump float;
  in vec4 tint;
  out vec4 result;
  void main() { result = tint; }`;

// Meshes, once or at many places: an instance has its place and its colour. Flattened: a shadow.
const SOLID = [`#version 300 es
  in vec3 position; in vec3 normal; in vec3 colour; in vec3 place;
  uniform mat4 camera; uniform float size; uniform float flatten;
  uniform vec3 eye; uniform float opacity;
  out vec4 tint;
  ${LIGHT}
  void main() {
    vec3 at = place + size * position;
    bool shadow = flatten > -1e5;
    if (shadow) at.z = flatten;
    vec3 c = shadow ? vec3(0.07, 0.085, 0.1) : shaded(colour, normal, normalize(eye - at));
    tint = vec4(c * opacity, opacity);
    gl_Position = camera * vec4(at, 1.0);
  }`, TINTED];

const LINES = [`#version 300 es
  in vec3 position; in vec4 colour;
  uniform mat4 camera;
  out vec4 tint;
  void main() { tint = vec4(colour.rgb * colour.a, colour.a); gl_Position = camera * vec4(position, 1.0); }`, TINTED];

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

export const programs = (gl) => ({ solid: linked(gl, SOLID), lines: linked(gl, LINES), picture: linked(gl, PICTURE) });
