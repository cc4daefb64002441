// The functions of the core as WebAssembly has them; core/reel.h says what they do.

type Address = number;
type Count = bigint;

/**
 * What every module of the core exports; sizes of memory and addresses are numbers, counts are
 * bigints.
 */
export interface SharedFunctions {
  readonly memory: WebAssembly.Memory;
  readonly __heap_base: WebAssembly.Global;
  reel_abi(): Count;
  reel_adjacency_memory(nVerts: Count, nFaces: Count): number;
  reel_adjacency(
    memory: Address,
    memorySize: number,
    faces: Address,
    nFaces: Count,
    nVerts: Count,
    starts: Address,
    near: Address,
  ): Count;
}

/** What the module for exact values exports beside it. */
export interface ExactFunctions extends SharedFunctions {
  reel_exact_memory(nFrames: Count, nItems: Count, width: Count): number;
  reel_exact_decode(
    memory: Address,
    memorySize: number,
    data: Address,
    sizeBytes: number,
    values: Address,
    nFrames: Count,
    nItems: Count,
    width: Count,
    size: Count,
    type: Count,
    starts: Address,
    near: Address,
  ): Count;
}

/** What the module for all else exports beside it. */
export interface Functions extends SharedFunctions {
  reel_basis_memory(nColumns: Count, nFrames: Count): number;
  reel_basis(
    memory: Address,
    memorySize: number,
    integers: Address,
    nModes: Count,
    nColumns: Count,
    nFrames: Count,
    rests: Address,
    restBits: Count,
    lengths: Address,
    nReused: Count,
    basis: Address,
  ): Count;
  reel_lengths(
    values: Address,
    nVerts: Count,
    nModes: Count,
    nReused: Count,
    finer: number,
    lengths: Address,
  ): Count;
  reel_connectivity_decode_memory(nVerts: Count, nFaces: Count): number;
  reel_connectivity_decode(
    memory: Address,
    memorySize: number,
    data: Address,
    sizeBytes: number,
    nVerts: Count,
    nFaces: Count,
    faces: Address,
  ): Count;
  reel_expected_memory(nRows: Count, nFaces: Count): number;
  reel_expected_find(
    memory: Address,
    memorySize: number,
    faces: Address,
    twins: Address,
    nRows: Count,
    nFaces: Count,
    order: Address,
    starts: Address,
    triples: Address,
  ): Count;
  reel_fields_memory(nColumns: Count, nPasses: Count, nNear: Count): number;
  reel_fields_decode(
    memory: Address,
    memorySize: number,
    data: Address,
    sizeBytes: number,
    nRows: Count,
    nWanted: Count,
    nColumns: Count,
    columns: Address,
    passStarts: Address,
    nPasses: Count,
    nearStarts: Address,
    near: Address,
    values: Address,
  ): Count;
  reel_frames_memory(nColumns: Count, nModes: Count, nWanted: Count): number;
  reel_frames(
    memory: Address,
    memorySize: number,
    basis: Address,
    packed: Address,
    precision: Count,
    nColumns: Count,
    nFrames: Count,
    nModes: Count,
    nVerts: Count,
    wanted: Address,
    nWanted: Count,
    correctionStarts: Address,
    corrected: Address,
    moves: Address,
    placement: Address,
    layout: Count,
    out: Address,
  ): Count;
  reel_hierarchy_memory(nVerts: Count, nNear: Count): number;
  reel_hierarchy(
    memory: Address,
    memorySize: number,
    starts: Address,
    near: Address,
    nVerts: Count,
    stencilSize: Count,
    order: Address,
    levelStarts: Address,
    levelResolutions: Address,
    smoothStarts: Address,
    stencil: Address,
    hops: Address,
    contexts: Address,
    smooth: Address,
  ): Count;
  reel_integers_memory(nTables: Count): number;
  reel_integers_decode(
    memory: Address,
    memorySize: number,
    data: Address,
    sizeBytes: number,
    lengths: Address,
    tables: Address,
    nRows: Count,
    nTables: Count,
    values: Address,
  ): Count;
  reel_order_memory(nVerts: Count, nFaces: Count): number;
  reel_order_decode(
    memory: Address,
    memorySize: number,
    data: Address,
    sizeBytes: number,
    faces: Address,
    twins: Address,
    nVerts: Count,
    nFaces: Count,
    withFaces: Count,
    corners: Address,
    sequence: Address,
  ): Count;
  reel_packed_bytes(nModes: Count, nVerts: Count, precision: Count): number;
  reel_pack(
    fields: Address,
    modeStride: Count,
    vertexStride: Count,
    step: number,
    precision: Count,
    order: Address,
    nModes: Count,
    nVerts: Count,
    first: Count,
    last: Count,
    packed: Address,
  ): Count;
  reel_patterns_memory(width: Count): number;
  reel_patterns_decode(
    memory: Address,
    memorySize: number,
    data: Address,
    sizeBytes: number,
    values: Address,
    nRows: Count,
    width: Count,
    size: Count,
    isFloat: Count,
    order: Address,
    starts: Address,
    triples: Address,
  ): Count;
  reel_predict_decode(mesh: Address, fields: Address, first: Count, last: Count): Count;
  reel_twins_memory(nVerts: Count, nFaces: Count): number;
  reel_twins(
    memory: Address,
    memorySize: number,
    faces: Address,
    nFaces: Count,
    nVerts: Count,
    twins: Address,
  ): Count;
}
