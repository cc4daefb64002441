// A packet: the length of a JSON header, the header, arrays. Everything is little-endian, as is
// every machine with WebGL, so arrays are views of the bytes that came.

const TYPES = {
  uint8: Uint8Array,
  int8: Int8Array,
  uint16: Uint16Array,
  int16: Int16Array,
  uint32: Uint32Array,
  float32: Float32Array,
};

type TypeName = keyof typeof TYPES;
type ArrayOf<N extends TypeName> = InstanceType<(typeof TYPES)[N]>;

interface Entry {
  name: string;
  type: TypeName;
  shape: number[];
  offset: number;
}

export class Packet {
  readonly fields: Record<string, unknown>;
  private readonly entries: Entry[];
  private readonly bodyStart: number;

  /** Reads the header; throws an Error that names `url` where the bytes are no packet. */
  constructor(
    private readonly bytes: ArrayBuffer,
    private readonly url: string,
  ) {
    const length = bytes.byteLength >= 4 ? new DataView(bytes).getUint32(0, true) : Infinity;
    this.bodyStart = 4 + length;
    if (this.bodyStart > bytes.byteLength) throw this.broken("its header is cut off");
    try {
      this.fields = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, length)));
      this.entries = this.fields.arrays as Entry[];
      this.entries.map((entry) => entry.name);
    } catch {
      throw this.broken("its header cannot be read");
    }
  }

  /** The array of a name, which must have this type and shape; null in a shape is any length. */
  array<N extends TypeName>(name: string, type: N, shape: (number | null)[]): ArrayOf<N> {
    const entry = this.entries.find((candidate) => candidate.name === name);
    if (!entry) throw this.broken(`it has no array "${name}"`);
    const fits =
      entry.type === type &&
      entry.shape.length === shape.length &&
      shape.every((length, axis) => length === null || length === entry.shape[axis]);
    if (!fits) {
      const wanted = shape.map((length) => length ?? "any").join(", ");
      throw this.broken(`"${name}" is ${entry.type} (${entry.shape}), not ${type} (${wanted})`);
    }
    const count = entry.shape.reduce((product, length) => product * length, 1);
    const start = this.bodyStart + entry.offset;
    if (start + count * TYPES[type].BYTES_PER_ELEMENT > this.bytes.byteLength) {
      throw this.broken(`"${name}" is cut off`);
    }
    return new TYPES[type](this.bytes, start, count) as ArrayOf<N>;
  }

  /** Shape of an array, or null where the packet has none of this name. */
  shapeOf(name: string): number[] | null {
    return this.entries.find((entry) => entry.name === name)?.shape ?? null;
  }

  private broken(what: string): Error {
    return new Error(`${this.url} arrived damaged: ${what}.`);
  }
}
