// A stream read section by section, where it has no index, or comes from front to back.

import { CorruptStreamError, MeshReelError } from "../errors.js";
import { ByteReader } from "./byte_reader.js";
import { counted } from "./counting.js";
import type { BlockPlace } from "./index_section.js";
import { Section, isOfBlock, sectionName } from "./layout.js";
import { type StoredSection, readSection, sectionEnd } from "./sections.js";

/** A block whose end has not come yet, and where the sections of each of its tracks begin. */
interface OpenBlock {
  readonly nFrames: number;
  readonly begins: number[];
}

/** The sections of a stream up to its end marker, or up to the first damaged one. */
export class Scan {
  /** Sections before the first block. */
  readonly leading: StoredSection[] = [];
  /** Positions of the complete blocks. */
  readonly places: BlockPlace[] = [];
  /** What ended it before the end marker. */
  damage: MeshReelError | null = null;
  /** Byte of the stream behind the last complete section. */
  position: number;
  private block: OpenBlock | null = null;
  private last = -1;
  private nTracks = 1;

  /** @param start - Byte behind the header. */
  constructor(start: number) {
    this.position = start;
  }

  /** Whether the end marker, or damage, was found. */
  get isDone(): boolean {
    return this.last === Section.END || this.damage !== null;
  }

  /**
   * Goes on as far as sections are there.
   *
   * @param bytes - The stream from its first byte on.
   * @param isAll - Whether no more will come.
   * @throws UnsupportedVersionError where a section is required and unknown.
   */
  advance(bytes: Uint8Array, isAll: boolean): void {
    const stretch = { bytes, start: 0 };
    const end = isAll ? bytes.length : Infinity;
    try {
      while (!this.isDone) {
        const behind = sectionEnd(stretch, this.position, end);
        if (behind === null || behind > bytes.length) return;
        const section = readSection(stretch, this.position, end);
        if (section.isKnown) this.note(section);
        this.position = section.end;
      }
    } catch (error) {
      if (!(error instanceof CorruptStreamError)) throw error;
      this.damage = error;
      const isBehindLast = this.last === Section.COEFFICIENTS || this.last === Section.VALUES;
      if (isBehindLast && this.block?.begins.length === this.nTracks) {
        this.close(this.block);
      }
    }
  }

  private note(section: StoredSection): void {
    const { id } = section;
    this.last = id;
    if (id === Section.BLOCK || id === Section.INDEX || id === Section.END) {
      if (this.block) this.close(this.block);
      const nFrames = id === Section.BLOCK ? readNFrames(section.payload) : 0;
      this.block = nFrames ? { nFrames, begins: [this.position] } : null;
    } else if (!this.block) {
      if (isOfBlock(id)) {
        throw new CorruptStreamError(`section ${sectionName(id)} is out of place`);
      }
      this.leading.push(section);
      if (id === Section.TRACK) this.nTracks++;
    } else if (id === Section.TRACK_BLOCK) {
      this.block.begins.push(this.position);
    }
  }

  /** Notes the place of a block, which ends here. */
  private close({ nFrames, begins }: OpenBlock): void {
    if (begins.length !== this.nTracks) {
      throw new CorruptStreamError(
        `the block at byte ${begins[0]} has ${counted(begins.length, "track")}; the stream ` +
          `announces ${this.nTracks}`,
      );
    }
    const sizes = begins.map((begin, i) => (begins[i + 1] ?? this.position) - begin);
    this.places.push({ nFrames, position: begins[0], sizes });
  }
}

function readNFrames(payload: Uint8Array): number {
  const nFrames = new ByteReader(payload).varint();
  if (!nFrames) {
    throw new CorruptStreamError("a block announces 0 frames; it must have at least 1");
  }
  return nFrames;
}
