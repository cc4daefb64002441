// Numbers with nouns in singular or plural: "1 frame", "2 frames".

/** The number and the noun; its plural where it is not made with an s. */
export function counted(count: number, noun: string, plural = `${noun}s`): string {
  return `${count} ${count === 1 ? noun : plural}`;
}
