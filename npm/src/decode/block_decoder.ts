// Blocks of a stream to fields and basis vectors, in any order.

import { CorruptStreamError } from "../errors.js";
import { type StoredBlock, blockPayload } from "../stream/block_sections.js";
import { Section } from "../stream/layout.js";
import { inverse } from "./connectivity.js";
import { noCorrections, readCorrections } from "./corrections.js";
import { DecodedBlock } from "./decoded_block.js";
import { FieldValues } from "./field_values.js";
import { decodeFields } from "./fields.js";
import type { Items } from "./items.js";
import { DEFAULT_MEMORY, requireBlock } from "./memory.js";
import { decodeBasis } from "./times.js";

const FIELDS_BYTES = 48;

/** Columns of positions. */
export const POSITION_COLUMNS = 3;

/**
 * Decodes a track in the blocks of a stream: its positions, or a further one. It keeps the fields
 * of the last key block: others refer to it.
 */
export class BlockDecoder {
  private key: { readonly number: number; readonly values: FieldValues } | null = null;

  /**
   * @param items - That the values lie on; they are not closed with the decoder.
   * @param nColumns - Numbers of a value.
   * @param memory - Bytes that decoding may take at once.
   */
  constructor(
    private readonly items: Items,
    private readonly nColumns: number,
    private readonly memory = DEFAULT_MEMORY,
  ) {}

  /**
   * What decodes a block, once all that it needs is there; throws then as `decode`.
   *
   * @param read - Reads the key block, where it is not the one that is kept.
   */
  async prepare(
    stored: StoredBlock,
    read: (number: number) => Promise<StoredBlock>,
  ): Promise<() => DecodedBlock> {
    const { number, layout } = stored;
    const wanted = number - layout.reference;
    const isHere = wanted === number || wanted < 0 || this.key?.number === wanted;
    const key = isHere ? stored : await read(wanted);
    return () => this.decode(stored, () => key);
  }

  /**
   * A block, which whoever asks closes.
   *
   * @param stored - As `readBlock` gives it.
   * @param keyBlock - The key block as it is stored, where it is not the one that is kept.
   * @throws CorruptStreamError where one of both is damaged.
   * @throws MemoryLimitError where one of both is larger than allowed.
   */
  decode(stored: StoredBlock, keyBlock: (number: number) => StoredBlock): DecodedBlock {
    requireBlock(this.memory, stored, [this.items.graph.nVerts, this.nColumns], 0);
    const key = stored.layout.reference ? this.keyOf(stored, keyBlock) : null;
    const { items, nColumns } = this;
    const { core, graph } = items;
    const { number, start, nFrames, nModes, layout } = stored;
    const { nReused, finer } = layout;
    const nKey = key?.nModes ?? 0;
    if (nReused > Math.min(nKey, nModes)) {
      throw new CorruptStreamError(`block ${number} reuses ${nReused} fields; there are ${nKey}`);
    }
    const reused =
      key && nReused
        ? { values: key.start, nVerts: graph.nVerts, nModes: nKey, nReused, finer }
        : null;
    const basis = core.during((scope) => {
      const data = blockPayload(stored, Section.BASIS);
      const found = decodeBasis(core, scope, data, nModes, nColumns, nFrames, layout, reused);
      return core.float64s(found, nColumns * nFrames * nModes).slice();
    });
    const moved = stored.sections.get(Section.CORRECTIONS);
    const corrections = moved
      ? readCorrections(core, moved, nColumns, nFrames, inverse(graph.sequence), this.memory)
      : noCorrections(nFrames);
    const values = this.decodeValues(stored, key);
    if (!key) this.keep(number, values.hold());
    const { rows } = items.hierarchyOf(layout.stencilSize);
    const made = [layout, basis, corrections, values, rows] as const;
    return new DecodedBlock(number, start, nFrames, graph.nVerts, nColumns, ...made);
  }

  /** Gives its memory back but that of blocks that are still open. */
  close(): void {
    this.key?.values.release();
    this.key = null;
  }

  private keyOf(stored: StoredBlock, keyBlock: (number: number) => StoredBlock): FieldValues {
    const { number, layout } = stored;
    const wanted = number - layout.reference;
    if (this.key?.number !== wanted) {
      if (wanted < 0) {
        throw new CorruptStreamError(`block ${number} refers to one before the first`);
      }
      const found = keyBlock(wanted);
      requireBlock(this.memory, found, [this.items.graph.nVerts, this.nColumns], 0);
      if (found.layout.reference) {
        throw new CorruptStreamError(
          `block ${number} refers to block ${wanted}, which refers to another itself`,
        );
      }
      this.keep(wanted, this.decodeValues(found, null));
    }
    const { values } = this.key!;
    if (values.stencilSize !== layout.stencilSize) {
      throw new CorruptStreamError(
        `block ${number} has stencils of ${layout.stencilSize}; that which it refers to has ` +
          `${values.stencilSize}`,
      );
    }
    return values;
  }

  private keep(number: number, values: FieldValues): void {
    this.key?.values.release();
    this.key = { number, values };
  }

  private decodeValues(stored: StoredBlock, key: FieldValues | null): FieldValues {
    const { items } = this;
    const { core } = items;
    const { nModes, layout } = stored;
    const { stencilSize, nLearned, nReused } = layout;
    const { nVerts } = items.graph;
    const data = blockPayload(stored, Section.COEFFICIENTS);
    const nOwn = nModes - nReused;
    return core.keeping((scope, keep) => {
      const { mesh, codingOrder } = items.hierarchyOf(stencilSize);
      const residuals = decodeFields(core, scope, data, nOwn, nVerts, () => codingOrder);
      const values = keep(scope.take(8 * nVerts * nModes));
      const own = nReused ? scope.take(8 * nVerts * nOwn) : values;
      const fields = scope.take(FIELDS_BYTES);
      const counts = [nVerts, 0, nOwn, 0, nLearned, 0, key?.nModes ?? 0, 0];
      core.uint32s(fields, 12).set([...counts, residuals, own, key?.start ?? 0, 0]);
      const result = core.functions.reel_predict_decode(mesh, fields, 0n, BigInt(nVerts));
      core.checked(result, "fields");
      if (key && nReused) this.join(values, key, nReused, own, nOwn);
      return new FieldValues(core, values, nModes, stencilSize);
    });
  }

  /** Puts fields of a block behind the first ones of its key block, vertex by vertex. */
  private join(
    values: number,
    key: FieldValues,
    nReused: number,
    own: number,
    nOwn: number,
  ): void {
    const { core, graph } = this.items;
    const nModes = nReused + nOwn;
    for (let v = 0; v < graph.nVerts; v++) {
      const all = core.float64s(values + 8 * v * nModes, nModes);
      all.set(core.float64s(key.start + 8 * v * key.nModes, nReused));
      all.set(core.float64s(own + 8 * v * nOwn, nOwn), nReused);
    }
  }
}
