// WebGL2: the receiver's map, and pictures of it. One draw adds up the photons, one the beams, one makes the picture.

import {BEAM_FRAGMENT, BEAM_VERTEX, SPLAT_FRAGMENT, SPLAT_VERTEX} from "./shaders.js";
import {SOLID_FRAGMENT, SOLID_VERTEX, VIEW_FRAGMENT, WHOLE_VERTEX} from "./shaders.js";
import {ABREAST, BEAM, PHOTON} from "./records.js";
import {SAMPLES} from "./spectra.js";
import {inverse} from "./views.js";

// What is missing for it, as a sentence; null where nothing is.
export function lackOf(gl) {
  if (!gl) return "WebGL2 is missing: use a current Firefox, Chrome, Edge or Safari, with hardware acceleration.";
  if (!gl.getExtension("EXT_color_buffer_float") && !gl.getExtension("EXT_color_buffer_half_float"))
    return "This device cannot add light up in floating-point pictures (EXT_color_buffer_float).";
  return null;
}

const FEWEST = 4000; // photons that stand for all

export class Light {
  // `records`: rows of photons and beams (records.js).
  constructor(gl, head, array, { photons, beams }) {
    this.gl = gl;
    this.head = head;
    // Sums in 32 bits where they can be blended; in 16 otherwise, less exact in bright places.
    this.isFull = Boolean(gl.getExtension("EXT_color_buffer_float") && gl.getExtension("EXT_float_blend"));
    gl.getExtension("EXT_color_buffer_half_float");
    this.splats = this.program(SPLAT_VERTEX, SPLAT_FRAGMENT);
    this.beams = this.program(BEAM_VERTEX, BEAM_FRAGMENT(Math.max(beams.most, 1)));
    this.view = this.program(WHOLE_VERTEX, VIEW_FRAGMENT);
    this.solid = this.program(SOLID_VERTEX, SOLID_FRAGMENT);
    for (const name of ["paths", "light", "edges"]) this[name] = this.texture();
    for (const name of ["base", "weight"]) this[name] = this.texture(gl.LINEAR);
    this.map = { texture: this.texture(), framebuffer: gl.createFramebuffer() };
    this.glass = { texture: this.texture(), framebuffer: gl.createFramebuffer() };
    this.whole = gl.createVertexArray();
    this.draws = 0;
    const thing = (kind, { rows, count }, floats) => {
      const records = this.texture();
      this.fill(records, (ABREAST * floats) / 4, Math.ceil(count / ABREAST), rows);
      return { kind, records, count, quads: this.corners(count) };
    };
    this.things = photons.count ? [thing(this.splats, photons, PHOTON)] : [];
    if (beams.count) this.things.push(thing(this.beams, beams, BEAM));
    if (beams.count) this.fill(this.edges, 1024, beams.edges.length / 4096, beams.edges);
    this.meshes = this.solids(head, array);
  }

  program(vertex, fragment) {
    const { gl } = this, program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost())
      throw new Error(
        gl.getAttachedShaders(program).map((s) => gl.getShaderInfoLog(s)) + gl.getProgramInfoLog(program));
    const places = {};
    return { program, at: (name) => (places[name] ??= gl.getUniformLocation(program, name)) };
  }

  texture(filter = this.gl.NEAREST) {
    const { gl } = this, texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    for (const kind of ["MIN", "MAG"]) gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_${kind}_FILTER`], filter);
    for (const side of ["S", "T"]) gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_WRAP_${side}`], gl.CLAMP_TO_EDGE);
    return texture;
  }

  // Floats, four a texel.
  fill(texture, width, height, values) {
    const { gl } = this;
    if (Math.max(width, height) > gl.getParameter(gl.MAX_TEXTURE_SIZE))
      throw new Error("this device cannot hold as many photons, polygons or lights as this page has.");
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, width, height, 0, gl.RGBA, gl.FLOAT, values);
  }

  picture(texture, bitmap) {
    const { gl } = this;
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, bitmap);
  }

  // Two triangles each, of four corners; instances of so few are slow on many a device. Every sixteenth comes first,
  // then every fourth: so many can stand for all.
  corners(count) {
    const { gl } = this, vertices = gl.createVertexArray(), list = new Uint32Array(6 * count);
    let at = 0;
    for (const step of [16, 4, 1])
      for (let i = 0; i < count; i += step)
        if (step === 16 || i % (4 * step)) list.set([0, 1, 2, 2, 1, 3].map((corner) => 4 * i + corner), 6 * at++);
    gl.bindVertexArray(vertices);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, list, gl.STATIC_DRAW);
    return vertices;
  }

  solids(head, array) {
    const { gl } = this, values = [];
    head.meshes.forEach(({ kind, colour, vertices, triangles }) => {
      const points = array(vertices), tint = kind === "glass" ? [0.8, 0.9, 1, 0.5] : [...colour, 1];
      for (const corner of array(triangles)) values.push(...points.subarray(3 * corner, 3 * corner + 3), ...tint);
    });
    const vertices = gl.createVertexArray();
    gl.bindVertexArray(vertices);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(values), gl.STATIC_DRAW);
    for (const [place, size, offset] of [[0, 3, 0], [1, 4, 12]]) {
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, gl.FLOAT, false, 28, offset);
    }
    return { vertices, count: values.length / 7 };
  }

  // Spectra and glasses: `lightTable` and `indexTable` of spectra.js.
  setTables(light, paths) {
    this.tables = light;
    this.fill(this.light, light.width, light.height, light.table);
    this.fill(this.paths, SAMPLES, 2, paths);
  }

  use({ program, at }, textures) {
    const { gl } = this;
    gl.useProgram(program);
    Object.entries(textures).forEach(([name, texture], unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.uniform1i(at(name), unit);
    });
    gl.activeTexture(gl.TEXTURE7);
    gl.uniform2i(at("size"), ...this.size);
    gl.uniformMatrix3fv(at("to_uv"), true, this.toUv);
    gl.uniformMatrix3fv(at("to_texel"), true, this.toTexel);
  }

  // Empty a target of so many pixels for draws that add to it.
  begin(target, width, height, internal, type, kept) {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.framebuffer);
    if (target.width !== width || target.height !== height) {
      Object.assign(target, { width, height });
      gl.bindTexture(gl.TEXTURE_2D, target.texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, internal, width, height, 0, gl.RGBA, type, null);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, target.texture, 0);
    }
    gl.viewport(0, 0, width, height);
    gl.blendColor(1, 1, 1, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.CONSTANT_COLOR, kept);
  }

  // Add up all light as it is seen by `toUv` (views.js) on so many pixels, or every `step`-th of them; `thin`: by one
  // photon in 1, 4 or 16, as much wider and brighter.
  gather(toUv, width, height, step = 1, thin = 1) {
    const { gl, head } = this;
    // Sizes that all levels divide.
    this.size = [width, height].map((side) => Math.max(32, 32 * Math.ceil(side / step / 32)));
    // From texels, whose rows go up.
    const [kx, ky] = [width / this.size[0], height / this.size[1]];
    this.toUv = [0, 3, 6].flatMap((r) => [kx * toUv[r], -ky * toUv[r + 1], toUv[r + 2] + height * toUv[r + 1]]);
    this.toTexel = inverse(this.toUv);
    const [format, type] = this.isFull ? [gl.RGBA32F, gl.FLOAT] : [gl.RGBA16F, gl.HALF_FLOAT];
    this.begin(this.map, 1.5 * this.size[0], this.size[1], format, type, gl.ONE);
    for (const { kind, records, count, quads } of this.things) {
      const share = [thin, thin / 4].find((k) => kind === this.splats && k > 1 && count > FEWEST * k) ?? 1;
      const drawn = Math.ceil(count / share), each = count / drawn;
      gl.bindVertexArray(quads);
      gl.blendColor(each, each, each, each);
      this.use(kind, { records, paths: this.paths, light: this.light, edges: this.edges });
      gl.uniform2f(kind.at("support"), ...this.tables.support);
      gl.uniform1i(kind.at("lines"), this.tables.lineCount);
      gl.uniform1f(kind.at("finest"), step > 1 ? 1 : 4);
      if (kind === this.splats) gl.uniform1f(kind.at("smoothing"), head.photons.smoothing * Math.sqrt(each));
      gl.drawElements(gl.TRIANGLES, 6 * drawn, gl.UNSIGNED_INT, 0);
      this.draws++;
    }
  }

  // The glass as `camera` (views.js) sees it, kept until it moves.
  drawGlass(camera, width, height) {
    const { gl } = this;
    this.begin(this.glass, width, height, gl.RGBA8, gl.UNSIGNED_BYTE, gl.ONE_MINUS_SRC_ALPHA);
    gl.useProgram(this.solid.program);
    gl.uniformMatrix4fv(this.solid.at("to_clip"), true, camera.toClip);
    gl.uniform3f(this.solid.at("eye"), ...camera.eye);
    gl.bindVertexArray(this.meshes.vertices);
    gl.drawArrays(gl.TRIANGLES, 0, this.meshes.count);
    this.draws++;
  }

  // The picture, into the canvas. `mode`: 0 camera, 1 from above, 2 in space.
  show(mode, exposure, mark, width, height) {
    const { gl, head } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, width, height);
    gl.disable(gl.BLEND);
    this.use(this.view, { map: this.map.texture, base: this.base, weight: this.weight, glass: this.glass.texture });
    gl.uniform2f(this.view.at("pixels"), width, height);
    gl.uniform1i(this.view.at("view"), mode);
    const { base_white = 0, weight_white = 0 } = head.camera ?? {};
    gl.uniform4f(this.view.at("whites"), base_white, weight_white, 2 ** exposure, 0);
    gl.uniform3f(this.view.at("diffuse"), ...(head.reflectance_rgb ?? [1, 1, 1]).map((r) => r / Math.PI));
    gl.uniform4f(this.view.at("mark"), ...(mark ?? [0, 0]), mark ? 1 : 0, Math.max(4, width / 90));
    gl.bindVertexArray(this.whole);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    this.draws++;
  }
}
