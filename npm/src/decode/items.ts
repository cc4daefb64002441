// What values lie on, with what follows from it, once for all that need it.

import type { Core } from "../core/core.js";
import type { ItemGraph } from "./connectivity.js";
import { type Hierarchy, buildHierarchy } from "./hierarchy.js";

/** A graph and the hierarchy that was asked for last. */
export class Items<Graph extends ItemGraph = ItemGraph> {
  private hierarchy: Hierarchy | null = null;
  private isOpen = true;

  constructor(
    readonly core: Core,
    readonly graph: Graph,
  ) {}

  /** The hierarchy with stencils of so many vertices; that of before where it serves. */
  hierarchyOf(stencilSize: number): Hierarchy {
    if (this.hierarchy?.stencilSize !== stencilSize) {
      this.release();
      this.hierarchy = buildHierarchy(this.core, this.graph, stencilSize);
    }
    return this.hierarchy;
  }

  /** Gives all memory back; more than once does nothing. */
  close(): void {
    if (this.isOpen) this.core.heap.give(this.graph.internalFaces);
    this.isOpen = false;
    this.release();
  }

  private release(): void {
    this.hierarchy?.parts.forEach((part) => this.core.heap.give(part));
    this.hierarchy = null;
  }
}
