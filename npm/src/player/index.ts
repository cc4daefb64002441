// `meshreel/player`: defines the element <reel-player>. The bundle has no dependencies.

import { ReelPlayerElement } from "./element.js";

export * from "../errors.js";
export { ReelPlayerElement } from "./element.js";

declare global {
  interface HTMLElementTagNameMap {
    "reel-player": ReelPlayerElement;
  }
}

if (typeof customElements !== "undefined" && !customElements.get("reel-player")) {
  customElements.define("reel-player", ReelPlayerElement);
}
