// Bytes of WebGL 2 buffers and textures of a page, tracked by intercepting its calls.

const BYTES = {
  [0x1908]: 4, // RGBA
  [0x8058]: 4, // RGBA8
  [0x8814]: 16, // RGBA32F
  [0x881a]: 8, // RGBA16F
  [0x8d88]: 8, // RGBA16I
  [0x8d76]: 8, // RGBA16UI
  [0x8d82]: 16, // RGBA32I
  [0x8d70]: 16, // RGBA32UI
  [0x822e]: 4, // R32F
  [0x822f]: 4, // RG16F
  [0x8230]: 8, // RG32F
  [0x8236]: 4, // R32UI
  [0x823c]: 8, // RG32UI
  [0x8229]: 1, // R8
};

const sizes = new Map();
const bound = new Map();
const { prototype } = WebGL2RenderingContext;

/** Total bytes of live buffers and textures. */
export function glBytes() {
  let sum = 0;
  for (const size of sizes.values()) sum += size;
  return sum;
}

function before(name, note) {
  const call = prototype[name];
  prototype[name] = function (...given) {
    note(...given);
    return call.apply(this, given);
  };
}

function texel(format) {
  if (!(format in BYTES)) throw new Error(`bytes of the format 0x${format.toString(16)}?`);
  return BYTES[format];
}

// Uploads go to the texture of the active unit, which is the one bound last.
for (const kind of ["Buffer", "Texture"]) {
  before(`bind${kind}`, (target, one) => bound.set(target, one));
  before(`delete${kind}`, (one) => sizes.delete(one));
}
before("bindBufferBase", (target, _, one) => bound.set(target, one));
before("bufferData", (target, data) => sizes.set(bound.get(target), data?.byteLength ?? data ?? 0));
before("texStorage2D", (target, levels, format, width, height) =>
  sizes.set(bound.get(target), texel(format) * width * height * (levels > 1 ? 4 / 3 : 1)),
);
before("texStorage3D", (target, levels, format, width, height, depth) =>
  sizes.set(bound.get(target), texel(format) * width * height * depth),
);
before("texImage2D", (target, level, format, width, height, ...rest) => {
  if (level === 0 && rest.length) sizes.set(bound.get(target), texel(format) * width * height);
});
before("texImage3D", (target, level, format, width, height, depth) =>
  sizes.set(bound.get(target), texel(format) * width * height * depth),
);
