/** What all views share: the lake, the skeleton, what is selected, what was said, what a person decided last. */
import { useEffect, useRef, useState, useSyncExternalStore } from "react";
import { get, post, remove, ServiceError, type LakeAbout, type Skeleton } from "./api";

export class Store<T> {
  private listeners = new Set<() => void>();
  constructor(private value: T) {}
  get = (): T => this.value;
  set = (value: T): void => {
    this.value = value;
    for (const listener of this.listeners) listener();
  };
  subscribe = (listener: () => void): (() => void) => {
    this.listeners.add(listener);
    return () => this.listeners.delete(listener);
  };
}

export function useStore<T>(store: Store<T>): T {
  return useSyncExternalStore(store.subscribe, store.get);
}

export const lake = new Store<LakeAbout | null>(null);
export const skeleton = new Store<Skeleton | null>(null);
/** Grows whenever a run has landed or a person has decided something: views ask anew. */
export const generation = new Store(0);
export const decided = new Store(0);
export const selection = new Store<ReadonlySet<string>>(new Set());
export interface Said { id: number; text: string; kind: "done" | "error"; undo?: (string | number)[] }
export const said = new Store<readonly Said[]>([]);
export interface Progress { stage: string; done: number; total: number; seconds_left: number | null }
export const progress = new Store<Progress | null>(null);

let numbered = 0;
export function say(text: string, kind: Said["kind"] = "done", undo?: (string | number)[]): void {
  const id = ++numbered;
  said.set([...said.get().slice(-2), { id, text, kind, undo }]);
  setTimeout(() => said.set(said.get().filter((one) => one.id !== id)), kind === "error" ? 9000 : 6000);
}
export function complain(error: unknown): void {
  if ((error as Error).name === "AbortError") return;
  say(error instanceof Error ? error.message : String(error), "error");
}

export function select(clips: Iterable<string>): void {
  selection.set(new Set(clips));
}
export function toggle(clip: string): void {
  const next = new Set(selection.get());
  if (!next.delete(clip)) next.add(clip);
  selection.set(next);
}

/** What a view shows of the service: the last answer stays until the next is there. */
export interface Loaded<T> { value: T | null; error: string | null; loading: boolean }
export function useLoaded<T>(key: string | null, load: (signal: AbortSignal) => Promise<T>): Loaded<T> {
  const [state, setState] = useState<Loaded<T>>({ value: null, error: null, loading: key !== null });
  const latest = useRef(load);
  latest.current = load;
  const of = useRef<string | null>(null);
  useEffect(() => {
    if (key === null) return setState({ value: null, error: null, loading: false });
    const stop = new AbortController();
    setState((before) => ({ ...before, loading: true }));
    latest.current(stop.signal).then(
      (value) => { of.current = key; setState({ value, error: null, loading: false }); },
      (error: Error) => {
        if (error.name !== "AbortError") setState((before) => ({ value: before.value, error: error.message, loading: false }));
      },
    );
    return () => stop.abort();
  }, [key]);
  return state;
}

export function who(): string {
  return localStorage.getItem("motionlake-who") || "someone";
}

export interface Decision { clips: string[]; kind: string; value: string; from?: number | null; to?: number | null }
const done: (string | number)[][] = [];

/** Keep what a person decided, in the place of earlier decisions; null if it could not be kept, which is said. */
export async function decide(decision: Decision, text: string, instead: string[] = []): Promise<string[] | null> {
  try {
    const { ids } = await post<{ ids: string[] }>("annotations", { ...decision, who: who() });
    if (instead.length) await remove("annotations", { id: instead });
    done.push(ids);
    decided.set(decided.get() + 1);
    say(text, "done", ids);
    return ids;
  } catch (error) {
    complain(error);
    return null;
  }
}

export async function undo(ids: (string | number)[] | undefined = done.at(-1)): Promise<void> {
  if (!ids) return say("There is nothing to undo.");
  try {
    await remove("annotations", { id: ids.map(String) });
    const place = done.indexOf(ids);
    if (place >= 0) done.splice(place, 1);
    decided.set(decided.get() + 1);
    said.set(said.get().filter((one) => one.undo !== ids));
    say(ids.length === 1 ? "Undone." : `Undone: ${ids.length} decisions.`);
  } catch (error) {
    complain(error);
  }
}

export async function start(): Promise<void> {
  const [about, bones] = await Promise.all([get<LakeAbout>("lake"), get<Skeleton>("skeleton")]);
  skeleton.set(bones);
  lake.set(about);
  listen();
}

/** What the service tells of itself: a run's progress, and that something landed. */
/** What the service makes once and gives out when it is ready: asked for again until then. */
export function useReady<T extends { ready?: boolean }>(key: string, load: (signal: AbortSignal) => Promise<T>): Loaded<T> & { waiting: boolean } {
  const [turn, setTurn] = useState(0);
  const loaded = useLoaded(`${key} ${turn}`, load);
  const waiting = loaded.value?.ready === false;
  useEffect(() => {
    if (!waiting || loaded.loading) return;
    const timer = setTimeout(() => setTurn((n) => n + 1), 1500);
    return () => clearTimeout(timer);
  }, [waiting, loaded.loading]);
  return { ...loaded, waiting };
}

function listen(): void {
  const events = new EventSource("/api/events");
  const heard = (event: MessageEvent<string>): void => {
    let told: { generation?: number | string; run?: Progress | null };
    try { told = JSON.parse(event.data); } catch { return; }
    if (told.run !== undefined) progress.set(told.run && told.run.done < told.run.total ? told.run : null);
    if (told.generation !== undefined && lake.get() && told.generation !== lake.get()!.generation) {
      get<LakeAbout>("lake").then((about) => {
        lake.set(about);
        generation.set(generation.get() + 1);
        say("The lake has changed: what is shown is up to date.");
      }, complain);
    }
  };
  for (const name of ["message", "run", "generation"]) events.addEventListener(name, heard as EventListener);
}

export function failed(error: unknown): string {
  return error instanceof ServiceError ? error.message : String(error);
}
