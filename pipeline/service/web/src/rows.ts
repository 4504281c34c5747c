/** Rows of clips, page by page as they come to the screen. */
import { useCallback, useEffect, useMemo, useRef, useState } from "react";
import { get, type ClipPage, type ClipRow } from "./api";

const PAGE = 120, WAIT = 40;

export const FACETS = [
  ["dataset", "Dataset"], ["label", "Label"], ["subject", "Subject"], ["rig", "Rig"], ["length", "Length"],
  ["quality", "Quality"], ["licence", "Licence"], ["synthetic", "Synthetic"], ["tags", "Tags"],
] as const;

/** The parameters of facets in the address. */
export const PARAMETERS: readonly string[] = [...FACETS.map(([column]) => column).filter((c) => c !== "length"), "seconds_from", "seconds_to"];

/** Which clips an address asks for: the parameters of the service. */
export function filterOf(at: URLSearchParams): URLSearchParams {
  const found = new URLSearchParams();
  for (const name of ["text", "where", ...PARAMETERS]) for (const value of at.getAll(name)) found.append(name, value);
  return found;
}

export function orderOf(at: URLSearchParams): URLSearchParams {
  const found = filterOf(at);
  for (const name of ["sort", "descending"]) if (at.get(name)) found.set(name, at.get(name)!);
  return found;
}

export interface Rows {
  total: number | null;
  error: string | null;
  at: (index: number) => ClipRow | undefined;
  /** Say which rows are on the screen. */
  show: (first: number, last: number) => void;
  /** All names of the query from one row to another. */
  names: (first: number, last: number) => Promise<string[]>;
}

/** `version` grows when rows must be asked for anew; what is shown stays until they are there. */
export function useRows(query: string, version: number): Rows {
  const [total, setTotal] = useState<number | null>(null);
  const [error, setError] = useState<string | null>(null);
  const [, redraw] = useState(0);
  const state = useRef({ key: "", pages: new Map<number, ClipRow[]>(), asked: new Set<number>(), stop: new AbortController() });
  const timer = useRef<ReturnType<typeof setTimeout>>(undefined);
  const shown = useRef<[number, number]>([0, 60]);
  const key = `${version}?${query}`;

  const load = useCallback(async (page: number): Promise<void> => {
    const mine = state.current;
    if (mine.asked.has(page)) return;
    mine.asked.add(page);
    const params = new URLSearchParams(query);
    params.set("offset", String(page * PAGE));
    params.set("limit", String(PAGE));
    try {
      const answer = await get<ClipPage>("clips", params, mine.stop.signal);
      if (mine !== state.current) return;
      if (mine.key !== key) { mine.key = key; mine.pages = new Map(); }
      mine.pages.set(page, answer.clips);
      setTotal(answer.total);
      setError(null);
      redraw((n) => n + 1);
    } catch (failed) {
      if (mine !== state.current || (failed as Error).name === "AbortError") return;
      mine.asked.delete(page);
      setError((failed as Error).message);
      setTotal(0);
    }
  }, [query, key]);

  useEffect(() => {
    state.current.stop.abort();
    state.current = { ...state.current, asked: new Set(), stop: new AbortController() };
    const [first, last] = shown.current;
    for (let page = Math.floor(first / PAGE); page <= Math.floor(last / PAGE); page++) void load(page);
    if (first >= PAGE) void load(0);
  }, [load]);

  const show = useCallback((first: number, last: number): void => {
    shown.current = [first, last];
    clearTimeout(timer.current);
    timer.current = setTimeout(() => {
      for (let page = Math.floor(first / PAGE); page <= Math.floor(last / PAGE); page++) void load(page);
    }, WAIT);
  }, [load]);

  const names = useCallback(async (first: number, last: number): Promise<string[]> => {
    const found: string[] = [];
    for (let offset = first; offset <= last; offset += 1000) {
      const params = new URLSearchParams(query);
      params.set("offset", String(offset));
      params.set("limit", String(Math.min(1000, last + 1 - offset)));
      const { clips } = await get<ClipPage>("clips", params);
      found.push(...clips.map((row) => row.clip));
      if (!clips.length) break;
    }
    return found;
  }, [query]);

  const at = useCallback((index: number) => state.current.pages.get(Math.floor(index / PAGE))?.[index % PAGE], []);
  return useMemo(() => ({ total, error, at, show, names }), [total, error, at, show, names]);
}
