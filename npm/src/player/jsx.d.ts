// `meshreel/jsx`: types of <reel-player> in JSX, for React 18 and 19. Contains no code.

import type { DetailedHTMLProps, HTMLAttributes } from "react";

import type { ReelPlayerElement } from "./element.js";
import type { ReelPlayerMarkup } from "./markup.js";

/** Attributes of `<reel-player>` in JSX. */
export interface ReelPlayerProps extends HTMLAttributes<ReelPlayerElement>, ReelPlayerMarkup {}

declare module "react" {
  namespace JSX {
    interface IntrinsicElements {
      "reel-player": DetailedHTMLProps<ReelPlayerProps, ReelPlayerElement>;
    }
  }
}
