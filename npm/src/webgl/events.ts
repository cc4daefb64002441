// Events of objects, in the style of three.js.

/** A function that receives an event of a type. */
type Listener<Events, Type extends keyof Events> = (
  event: Events[Type] & { type: Type; target: unknown },
) => void;

/** Dispatches events by their type; `Events` has the other properties of each. */
export class EventDispatcher<Events extends object = object> {
  readonly #listeners = new Map<PropertyKey, Set<(event: never) => void>>();

  addEventListener<Type extends keyof Events>(type: Type, listener: Listener<Events, Type>): void {
    const listeners = this.#listeners.get(type) ?? new Set();
    this.#listeners.set(type, listeners.add(listener));
  }

  removeEventListener<Type extends keyof Events>(type: Type, listener: Listener<Events, Type>): void {
    this.#listeners.get(type)?.delete(listener);
  }

  dispatchEvent<Type extends keyof Events>(event: { type: Type } & Events[Type]): void {
    const listeners = this.#listeners.get(event.type) ?? [];
    for (const listener of [...listeners]) listener({ ...event, target: this } as never);
  }
}

/** An object with resources on the GPU. */
export class Disposable extends EventDispatcher<{ dispose: object }> {
  /** Free its resources; they are created again if it is used afterwards. */
  dispose(): void {
    this.dispatchEvent({ type: "dispose" });
  }
}
