// Reflects the attributes of a player as properties.

import { ATTRIBUTE_NAMES, type AttributeName, ATTRIBUTES } from "./settings.js";

/** Without a DOM, as in server-side rendering, importing the script must not fail. */
const Element = typeof HTMLElement === "undefined" ? (class {} as typeof HTMLElement) : HTMLElement;

/** Types of properties by those of attributes. */
interface PropertyTypes {
  text: string | null;
  flag: boolean;
  number: number | null;
  switch: boolean;
  loop: boolean | string;
}

type PropertyName<Name extends string> = Name extends `${infer First}-${infer Rest}`
  ? `${First}${Capitalize<PropertyName<Rest>>}`
  : Name;

/** The attributes as properties: `cameraOrbit` for `camera-orbit`. */
type AttributeProperties = {
  -readonly [Name in AttributeName as PropertyName<Name>]: PropertyTypes[(typeof ATTRIBUTES)[Name]];
};

export interface PlayerAttributes extends AttributeProperties {}

/** Base class of the player: each attribute is also a property. */
export abstract class PlayerAttributes extends Element {
  /** Apply properties that were set before the element was defined. */
  protected upgradeProperties(): void {
    for (const name of ATTRIBUTE_NAMES) {
      const property = propertyName(name);
      if (!Object.hasOwn(this, property)) continue;
      const value: unknown = Reflect.get(this, property);
      Reflect.deleteProperty(this, property);
      Reflect.set(this, property, value);
    }
  }
}

for (const name of ATTRIBUTE_NAMES) {
  Object.defineProperty(PlayerAttributes.prototype, propertyName(name), {
    configurable: true,
    enumerable: true,
    get(this: HTMLElement) {
      return parseValue(name, this.getAttribute(name));
    },
    set(this: HTMLElement, value: unknown) {
      const isOff = value === null || value === undefined || value === false;
      if (isOff && name !== "interpolate") this.removeAttribute(name);
      else this.setAttribute(name, value === true ? "" : String(value));
    },
  });
}

function parseValue(name: AttributeName, value: string | null): unknown {
  switch (ATTRIBUTES[name]) {
    case "flag":
      return value !== null;
    case "number":
      return value === null ? null : Number(value);
    case "switch":
      return value !== "false";
    case "loop":
      return value !== null && (/^(loop|repeat)?$/.test(value) || value);
    default:
      return value;
  }
}

function propertyName(name: AttributeName): string {
  return name.replace(/-(.)/g, (_, letter: string) => letter.toUpperCase());
}
