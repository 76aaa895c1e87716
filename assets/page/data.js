// The page's data: a head in JSON, and arrays of numbers in one block of bytes (docs/pages.md).

// Bytes of the block: deflated, base64.
async function bytesOf(text) {
  const letters = atob(text.trim());
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) bytes[i] = letters.charCodeAt(i);
  const inflated = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(inflated).arrayBuffer());
}

// Value of every half float, by its bits.
function halfFloats() {
  const values = new Float32Array(65536);
  for (let bits = 0; bits < 65536; bits++) {
    const exponent = (bits >> 10) & 31, fraction = (bits & 1023) / 1024;
    const isNormal = exponent > 0, size = (isNormal + fraction) * 2 ** (isNormal ? exponent - 15 : -14); // all finite
    values[bits] = bits & 32768 ? -size : size;
  }
  return values;
}

// `head`, and `array(name)`: its numbers, or null where there is none; 16 bits without a sign are shares of 1.
export async function readData(page) {
  const head = JSON.parse(page.getElementById("head").textContent);
  const bytes = await bytesOf(page.getElementById("blob").textContent);
  let halves = null;
  const kinds = { f4: Float32Array, f2: Uint16Array, u4: Uint32Array, u2: Uint16Array, u1: Uint8Array };
  const raw = (name) => {
    const { dtype, shape, offset } = head.arrays[name];
    return new kinds[dtype](bytes.buffer, bytes.byteOffset + offset, shape.reduce((a, b) => a * b, 1));
  };
  const array = (name) => {
    if (!head.arrays[name]) return null;
    const stored = raw(name), { dtype } = head.arrays[name];
    if (dtype !== "f2" && dtype !== "u2") return stored;
    const valueOf = dtype === "f2" ? (bits) => (halves ??= halfFloats())[bits] : (value) => value / 65535;
    return Float32Array.from(stored, valueOf);
  };
  const picture = (name, type) =>
    createImageBitmap(new Blob([raw(name)], { type }), { colorSpaceConversion: "none", premultiplyAlpha: "none" });
  return { head, array, picture };
}
