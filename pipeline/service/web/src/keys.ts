/** Keys of the views: each view says which keys it has while it is shown, and the ? page lists them. */
import { useEffect, useRef } from "react";

export interface Key { keys: string; does: string; act?: (event: KeyboardEvent) => void }

/** Whether a person is writing, so that letters are letters. */
export function writing(target: EventTarget | null): boolean {
  const element = target as HTMLElement | null;
  if (!element?.closest) return false;
  const input = element.closest("input, textarea, select, [contenteditable]");
  return Boolean(input) && !(input instanceof HTMLInputElement && ["checkbox", "radio", "range", "button"].includes(input.type));
}

const shown = new Set<readonly Key[]>();
export function keysShown(): readonly Key[] {
  return [...shown].flat();
}

function named(event: KeyboardEvent): string {
  const letter = event.key === " " ? "Space" : event.key;
  const shift = event.shiftKey && (letter.length > 1 || /[a-z]/i.test(letter)) ? "Shift+" : "";
  return `${event.ctrlKey || event.metaKey ? "Ctrl+" : ""}${shift}${letter.length === 1 ? letter.toLowerCase() : letter}`;
}

/** Keys of a view. `keys`: "Space", "Shift+ArrowLeft", "Ctrl+a", several with " / " between them. */
export function useKeys(keys: readonly Key[]): void {
  const latest = useRef(keys);
  latest.current = keys;
  const listed = keys.map((key) => key.keys + key.does).join();
  useEffect(() => {
    const own = latest.current;
    shown.add(own);
    return () => { shown.delete(own); };
  }, [listed]);
  useEffect(() => {
    const pressed = (event: KeyboardEvent): void => {
      if (event.defaultPrevented || writing(event.target) || document.querySelector("dialog[open]")) return;
      const name = named(event);
      const target = event.target as HTMLElement;
      const own = target.closest?.("button, a, summary, input, [role=tab]"); // these are pressed by it
      if ((name === "Space" || name === "Enter") && own) return;
      const key = latest.current.find((one) => one.act && one.keys.split(" / ").includes(name));
      if (!key) return;
      event.preventDefault();
      key.act!(event);
    };
    document.addEventListener("keydown", pressed);
    return () => document.removeEventListener("keydown", pressed);
  }, []);
}
