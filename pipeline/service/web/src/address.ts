/** The state of every view lies in the address, so that it can be shared, and gone back to. */
import { useSyncExternalStore } from "react";

type Value = string | number | boolean | readonly string[] | null | undefined;
export type Changes = Readonly<Record<string, Value>>;

const listeners = new Set<() => void>();
let params = new URLSearchParams(location.search);

function changed(): void {
  params = new URLSearchParams(location.search);
  for (const listener of listeners) listener();
}
window.addEventListener("popstate", changed);

function subscribe(listener: () => void): () => void {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

export function address(): URLSearchParams {
  return params;
}

export function useAddress(): URLSearchParams {
  return useSyncExternalStore(subscribe, address);
}

function written(base: URLSearchParams, changes: Changes): URLSearchParams {
  const next = new URLSearchParams(base);
  for (const [name, value] of Object.entries(changes)) {
    next.delete(name);
    if (value === null || value === undefined || value === false) continue;
    if (typeof value === "object") for (const one of value) next.append(name, one);
    else if (value === true) next.set(name, "true");
    else next.set(name, String(value));
  }
  return next;
}

/** The address of a view of its own, with nothing of the present one. */
export function link(changes: Changes): string {
  const query = written(new URLSearchParams(), changes).toString();
  return query ? `/?${query}` : "/";
}

function show(url: string, replace: boolean): void {
  if (url === location.pathname + location.search) return;
  if (replace) history.replaceState(null, "", url);
  else history.pushState(null, "", url);
  changed();
}

/** Open another view. */
export function go(changes: Changes): void {
  show(link(changes), false);
  window.scrollTo(0, 0);
}

/** Change the present view; `replace`: without a step to go back to. */
export function change(changes: Changes, replace = false): void {
  const query = written(params, changes).toString();
  show(query ? `/?${query}` : "/", replace);
}

/** What a link does when it is clicked: the view changes without a new page, unless a new tab is asked for. */
export function follow(event: React.MouseEvent<HTMLAnchorElement>): void {
  if (event.defaultPrevented || event.button || event.metaKey || event.ctrlKey || event.shiftKey || event.altKey) return;
  event.preventDefault();
  show(event.currentTarget.pathname + event.currentTarget.search, false);
  window.scrollTo(0, 0);
}

export function numberAt(at: URLSearchParams, name: string): number | null {
  const text = at.get(name);
  const value = text === null || text === "" ? NaN : Number(text);
  return Number.isFinite(value) ? value : null;
}
