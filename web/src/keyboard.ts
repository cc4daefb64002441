// Keys, as the help lists them.

export type Actions = Record<string, () => unknown>;

/** Listens for keys, except where one is typed into a control that uses it itself. */
export function listenForKeys(actions: Actions): void {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || isUsedBy(event)) return;
    const key = event.shiftKey && event.key.startsWith("Arrow") ? `Shift${event.key}` : event.key;
    const action = actions[key] ?? actions[key.toLowerCase()];
    if (!action) return;
    event.preventDefault();
    action();
  });
}

function isUsedBy({ target, key }: KeyboardEvent): boolean {
  if (document.querySelector("dialog[open]")) return true;
  if (!(target instanceof HTMLElement)) return false;
  if (target instanceof HTMLSelectElement) return true;
  if (target instanceof HTMLInputElement)
    return key === " " || (target.id !== "scrub" && isMove(key));
  return target instanceof HTMLButtonElement && (key === " " || key === "Enter");
}

function isMove(key: string): boolean {
  return key.startsWith("Arrow") || key === "Home" || key === "End";
}
