// @ts-check
/**
 * Draws float pictures with WebGL 2: one context and one canvas for every box in which a picture is seen.
 *
 * A picture is a texture of half floats, as the server sends them. The shader averages what a screen pixel covers:
 * above 100 % that is nearest neighbour with clean pixel edges, below it is a box filter. Errors are computed for each
 * pixel and then averaged, so an error map looks as dark or bright at any zoom as its numbers are. The formulas are
 * those of `maths.js`.
 */
import { INFERNO_STOPS, NOT_A_NUMBER, SIGNED_STOPS } from "./colours.js";
import { RELATIVE_EPSILON } from "./maths.js";

/** @typedef {import("./maths.js").Box} Box */
/** @typedef {import("./maths.js").Place} Place */
/** @typedef {import("./settings.js").Mode} Mode */
/** @typedef {import("./settings.js").Tone} Tone */
/** @typedef {import("./pictures.js").Pixels} Pixels */
/**
 * A picture in a part of the canvas, in CSS pixels. `max` ends the colour map.
 * @typedef {object} Drawing
 * @property {Pixels} pixels
 * @property {Pixels | null} reference needed in all modes but "picture"; of the same size
 * @property {Place} place
 * @property {Box} clip
 * @property {Mode} mode
 * @property {Tone} tone
 * @property {number} ev
 * @property {number} max
 */

const TEXTURE_BYTES = 256 * 2 ** 20; // what is kept on the GPU beyond what is on the screen
/** Their places are their numbers in the shader. */
const KINDS = ["srgb", "gamma22", "falsecolour", "signed", "absolute", "squared", "relative"];

const VERTEX = `#version 300 es
void main() { // one triangle that covers everything
  gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0);
}`;

const FRAGMENT = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;

uniform sampler2D picture;
uniform sampler2D reference;
uniform float canvas_height;
uniform vec2 corner;  // of the picture on the canvas, device pixels, y down
uniform float scale;  // device pixels per picture pixel
uniform int kind;
uniform float gain;   // 2^EV, or 1 / maximum of a colour map
uniform vec3 inferno[${INFERNO_STOPS.length}];
uniform vec3 diverging[3];
uniform vec3 not_a_number;
out vec4 colour;

const int TAPS = 12;  // texels per axis that one screen pixel reads at most
const float LEAST = 1e-3;  // a sliver of a neighbouring texel is rounding, not coverage

bool broken(vec3 v) {  // isnan() may be optimised away
  return any(equal(floatBitsToUint(v) & 0x7f800000u, uvec3(0x7f800000u)));
}

vec3 measured(vec3 v, vec3 r) {
  vec3 d = v - r;
  if (kind == 2) return vec3(dot(v, vec3(0.2126, 0.7152, 0.0722)));
  if (kind == 3) return vec3((d.r + d.g + d.b) / 3.0);
  if (kind == 4) return vec3((abs(d.r) + abs(d.g) + abs(d.b)) / 3.0);
  if (kind == 5) return vec3(dot(d, d) / 3.0);
  if (kind == 6) { vec3 e = d * d / (r * r + ${RELATIVE_EPSILON}); return vec3((e.r + e.g + e.b) / 3.0); }
  return v;
}

vec3 shown(vec3 v) {
  v *= gain;
  if (kind == 0) {
    v = clamp(v, 0.0, 1.0);
    return mix(1.055 * pow(v, vec3(1.0 / 2.4)) - 0.055, 12.92 * v, vec3(lessThanEqual(v, vec3(0.0031308))));
  }
  if (kind == 1) return pow(clamp(v, 0.0, 1.0), vec3(1.0 / 2.2));
  if (kind == 3) return mix(diverging[1], v.r < 0.0 ? diverging[0] : diverging[2], min(abs(v.r), 1.0));
  float at = clamp(v.r, 0.0, 1.0) * ${INFERNO_STOPS.length - 1}.0;
  int low = min(int(at), ${INFERNO_STOPS.length - 2});
  return mix(inferno[low], inferno[low + 1], at - float(low));
}

void main() {
  vec2 size = vec2(textureSize(picture, 0));
  vec2 middle = (vec2(gl_FragCoord.x, canvas_height - gl_FragCoord.y) - corner) / scale;
  vec2 low = max(middle - 0.5 / scale, 0.0);
  vec2 high = min(middle + 0.5 / scale, size);
  if (any(lessThanEqual(high - low, vec2(0.0)))) discard;
  ivec2 first = ivec2(low);
  ivec2 last = min(ivec2(high), ivec2(size) - 1);
  ivec2 stride = (last - first + TAPS) / TAPS;
  vec3 sum = vec3(0.0);
  float weight = 0.0;
  for (int y = first.y; y <= last.y; y += stride.y) {
    float height = min(high.y, float(y) + 1.0) - max(low.y, float(y));
    for (int x = first.x; x <= last.x; x += stride.x) {
      float area = height * (min(high.x, float(x) + 1.0) - max(low.x, float(x)));
      if (area < LEAST * (high.x - low.x) * (high.y - low.y)) continue;
      vec3 v = texelFetch(picture, ivec2(x, y), 0).rgb;
      vec3 r = kind > 2 ? texelFetch(reference, ivec2(x, y), 0).rgb : vec3(0.0);
      if (broken(v) || broken(r)) {
        if (area < 0.5 * min(1.0, 1.0 / (scale * scale))) continue;
        colour = vec4(not_a_number, 1.0);
        return;
      }
      sum += area * measured(v, r);
      weight += area;
    }
  }
  colour = vec4(weight > 0.0 ? shown(sum / weight) : not_a_number, 1.0);
}`;

/** Thrown where the browser has no WebGL 2, or it is switched off. */
export class NoWebGl extends Error {}

export class Painter {
  /** @param {HTMLCanvasElement} canvas @param {(lost: boolean) => void} onContext the context was lost, or is back */
  constructor(canvas, onContext) {
    this.canvas = canvas;
    // No antialias: there is one triangle. Transparent: the page shows through where no picture is.
    const gl = canvas.getContext("webgl2", { antialias: false, depth: false, powerPreference: "low-power" });
    if (!gl) throw new NoWebGl("this browser has no WebGL 2, or it is switched off");
    this.gl = gl;
    this.onContext = onContext;
    /** @type {Map<Pixels, WebGLTexture>} oldest use first */
    this.textures = new Map();
    this.bytes = 0;
    canvas.addEventListener("webglcontextlost", this.lost);
    canvas.addEventListener("webglcontextrestored", this.restored);
    this.prepare();
  }

  lost = (/** @type {Event} */ event) => {
    event.preventDefault(); // asks the browser to give it back
    this.textures.clear();
    this.bytes = 0;
    this.onContext(true);
  };

  restored = () => {
    this.prepare();
    this.onContext(false);
  };

  /** Compiles the program and sets what never changes. */
  prepare() {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [type, source] of /** @type {const} */ ([
      [gl.VERTEX_SHADER, VERTEX],
      [gl.FRAGMENT_SHADER, FRAGMENT],
    ])) {
      const shader = gl.createShader(type);
      if (!shader) return; // the context is lost again
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
      gl.deleteShader(shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      throw new NoWebGl(`this browser's WebGL 2 cannot compile the viewer's shader: ${gl.getProgramInfoLog(program)}`);
    }
    gl.useProgram(program);
    this.uniform = (/** @type {string} */ name) => gl.getUniformLocation(program, name);
    gl.uniform1i(this.uniform("picture"), 0);
    gl.uniform1i(this.uniform("reference"), 1);
    gl.uniform3fv(this.uniform("inferno"), INFERNO_STOPS.flat());
    gl.uniform3fv(this.uniform("diverging"), SIGNED_STOPS.flat());
    gl.uniform3fv(this.uniform("not_a_number"), [...NOT_A_NUMBER]);
    this.at = {
      height: this.uniform("canvas_height"),
      corner: this.uniform("corner"),
      scale: this.uniform("scale"),
      kind: this.uniform("kind"),
      gain: this.uniform("gain"),
    };
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 2);
  }

  /** @param {readonly Drawing[]} drawings @param {number} ratio device pixels per CSS pixel */
  paint(drawings, ratio) {
    const { gl, canvas, at } = this;
    if (gl.isContextLost() || !at) return;
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.disable(gl.SCISSOR_TEST);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.enable(gl.SCISSOR_TEST);
    gl.uniform1f(at.height, canvas.height);
    const used = new Set();
    for (const { pixels, reference, place, clip, mode, tone, ev, max } of drawings) {
      // Only where the picture is: the shader would find out pixel by pixel.
      const left = Math.max(Math.round(clip.x * ratio), Math.floor(place.left * ratio));
      const top = Math.max(Math.round(clip.y * ratio), Math.floor(place.top * ratio));
      const right = Math.min(
        Math.round((clip.x + clip.width) * ratio),
        Math.ceil((place.left + pixels.width * place.scale) * ratio),
      );
      const bottom = Math.min(
        Math.round((clip.y + clip.height) * ratio),
        Math.ceil((place.top + pixels.height * place.scale) * ratio),
      );
      if (right <= left || bottom <= top) continue;
      gl.scissor(left, canvas.height - bottom, right - left, bottom - top);
      const kind = mode === "picture" ? tone : mode;
      gl.activeTexture(gl.TEXTURE1);
      gl.bindTexture(gl.TEXTURE_2D, this.texture(reference ?? pixels));
      gl.activeTexture(gl.TEXTURE0);
      gl.bindTexture(gl.TEXTURE_2D, this.texture(pixels));
      gl.uniform2f(at.corner, place.left * ratio, place.top * ratio);
      gl.uniform1f(at.scale, place.scale * ratio);
      gl.uniform1i(at.kind, KINDS.indexOf(kind));
      gl.uniform1f(at.gain, kind === "srgb" || kind === "gamma22" ? 2 ** ev : 1 / max);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
      used.add(pixels).add(reference);
    }
    this.evict(used);
  }

  /** @param {Pixels} pixels @returns {WebGLTexture | null} */
  texture(pixels) {
    const { gl, textures } = this;
    let texture = textures.get(pixels);
    if (texture) {
      textures.delete(pixels); // to the young end
    } else {
      texture = gl.createTexture();
      this.bytes += pixels.halves.byteLength;
      gl.bindTexture(gl.TEXTURE_2D, texture);
      for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
        gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
      for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T])
        gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
      const { width, height, halves } = pixels;
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB16F, width, height, 0, gl.RGB, gl.HALF_FLOAT, halves);
    }
    textures.set(pixels, texture);
    return texture;
  }

  /** @param {Set<Pixels | null>} used what has to stay */
  evict(used) {
    for (const [pixels, texture] of this.textures) {
      if (this.bytes <= TEXTURE_BYTES) return;
      if (used.has(pixels)) continue;
      this.gl.deleteTexture(texture);
      this.textures.delete(pixels);
      this.bytes -= pixels.halves.byteLength;
    }
  }

  /** Gives the GPU's memory back at once: browsers keep few contexts, and collect them late. */
  close() {
    this.canvas.removeEventListener("webglcontextlost", this.lost);
    this.canvas.removeEventListener("webglcontextrestored", this.restored);
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }
}
