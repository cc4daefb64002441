// Blocks of a stream to fields and basis vectors, in any order.

import type { Core } from "../core/core.js";
import { CorruptStreamError } from "../errors.js";
import { type Layout, type StoredBlock, blockPayload } from "../stream/block_sections.js";
import type { Header } from "../stream/header.js";
import { Section } from "../stream/layout.js";
import type { StoredSection } from "../stream/sections.js";
import { type Connectivity, decodeConnectivity, inverse } from "./connectivity.js";
import { noCorrections, readCorrections } from "./corrections.js";
import { DecodedBlock } from "./decoded_block.js";
import { FieldValues } from "./field_values.js";
import { decodeFields } from "./fields.js";
import { type Hierarchy, buildHierarchy } from "./hierarchy.js";
import { decodeBasis } from "./times.js";

const FIELDS_BYTES = 48;

/**
 * Decodes blocks of a stream. It keeps what follows from connectivity, and the fields of the last
 * key block: others refer to it.
 */
export class BlockDecoder {
  readonly connectivity: Connectivity;
  private hierarchy: Hierarchy | null = null;
  private key: { readonly number: number; readonly values: FieldValues } | null = null;

  /**
   * @param leading - Sections before the first block.
   * @throws CorruptStreamError where connectivity or order are damaged.
   * @throws MeshReelError where the mesh is too large for a page.
   */
  constructor(
    readonly core: Core,
    readonly header: Header,
    leading: readonly StoredSection[],
  ) {
    this.connectivity = core.keeping((scope, keep) =>
      decodeConnectivity(core, scope, keep, header, leading),
    );
  }

  /** Makes ready what blocks with such fields need. */
  prepare({ stencilSize }: Layout): void {
    this.hierarchyOf(stencilSize);
  }

  /** Whether a block can be decoded without the bytes of its key block. */
  hasKeyOf(stored: StoredBlock): boolean {
    const { reference } = stored.layout;
    return !reference || this.key?.number === stored.number - reference;
  }

  /**
   * A block, which whoever asks closes.
   *
   * @param stored - As `readBlock` gives it.
   * @param keyBlock - The key block as it is stored; asked for where `hasKeyOf` says so.
   * @throws CorruptStreamError where one of both is damaged.
   */
  decode(stored: StoredBlock, keyBlock: (number: number) => StoredBlock): DecodedBlock {
    const key = stored.layout.reference ? this.keyOf(stored, keyBlock) : null;
    const { core, connectivity } = this;
    const { number, start, nFrames, nModes, layout } = stored;
    const basis = core.during((scope) => {
      const data = blockPayload(stored, Section.BASIS);
      const found = decodeBasis(core, scope, data, nModes, nFrames);
      return core.float64s(found, 3 * nFrames * nModes).slice();
    });
    const moved = stored.sections.get(Section.CORRECTIONS);
    const corrections = moved
      ? readCorrections(core, moved, nFrames, inverse(connectivity.sequence))
      : noCorrections(nFrames);
    const values = this.decodeValues(stored, key);
    if (!key) this.keep(number, values.hold());
    const { rows } = this.hierarchyOf(layout.stencilSize);
    const { nVerts } = connectivity;
    const made = [basis, corrections, values, rows] as const;
    return new DecodedBlock(number, start, nFrames, nVerts, layout, ...made);
  }

  /** Gives all memory back but that of blocks that are still open. */
  close(): void {
    this.key?.values.release();
    this.key = null;
    this.hierarchy?.parts.forEach((part) => this.core.heap.give(part));
    this.hierarchy = null;
    this.core.heap.give(this.connectivity.internalFaces);
  }

  private keyOf(stored: StoredBlock, keyBlock: (number: number) => StoredBlock): FieldValues {
    const { number, layout } = stored;
    const wanted = number - layout.reference;
    if (this.key?.number !== wanted) {
      if (wanted < 0) {
        throw new CorruptStreamError(`block ${number} refers to one before the first`);
      }
      const found = keyBlock(wanted);
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
    const { core } = this;
    const { nModes, layout } = stored;
    const { stencilSize, nLearned } = layout;
    const { nVerts } = this.connectivity;
    const data = blockPayload(stored, Section.COEFFICIENTS);
    return core.keeping((scope, keep) => {
      const { mesh, codingOrder } = this.hierarchyOf(stencilSize);
      const residuals = decodeFields(core, scope, data, nModes, nVerts, () => codingOrder);
      const values = keep(scope.take(8 * nVerts * nModes));
      const fields = scope.take(FIELDS_BYTES);
      const counts = [nVerts, 0, nModes, 0, nLearned, 0, key?.nModes ?? 0, 0];
      core.uint32s(fields, 12).set([...counts, residuals, values, key?.start ?? 0, 0]);
      const result = core.functions.reel_predict_decode(mesh, fields, 0n, BigInt(nVerts));
      core.checked(result, "fields");
      return new FieldValues(core, values, nModes, stencilSize);
    });
  }

  /** The hierarchy with stencils of so many vertices; that of the block before where it serves. */
  private hierarchyOf(stencilSize: number): Hierarchy {
    if (this.hierarchy?.stencilSize !== stencilSize) {
      this.hierarchy?.parts.forEach((part) => this.core.heap.give(part));
      this.hierarchy = null;
      this.hierarchy = buildHierarchy(this.core, this.connectivity, stencilSize);
    }
    return this.hierarchy;
  }
}
