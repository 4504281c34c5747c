/** What the service answers, and how it is asked. */
export interface Method { name: string; title: string; finds: "clip" | "range"; ready: boolean }
export interface LakeAbout {
  name: string; version: string; clips: number; seconds: number; datasets: string[];
  facets: { column: string; title: string }[];
  search_methods: Method[]; exports: string[]; read_only: boolean; generation: number | string;
}
export interface ClipRow {
  clip: string; dataset: string; label: string | null; subject: string | null; rig: string | null; frames: number;
  fps: number; seconds: number; quality: string | null; licence: string | null; synthetic: boolean; tags: string[];
}
export interface ClipPage { total: number; offset: number; clips: ClipRow[] }
export interface FacetValue { value: string | boolean | null; clips: number }
export interface FacetSpan { from: number; to: number; clips: number }
export type Facets = Record<string, (FacetValue | FacetSpan)[]>;
export interface Hit {
  clip: string; from: number | null; to: number | null; distance: number; mirrored: boolean; label: string | null;
  /** By method: how near the answer is by it, from 0 to 1. */
  explanation: Record<string, number>;
  /** By joint: how far apart the two motions are, metres. */
  joints?: Record<string, number>;
  dataset?: string; seconds?: number;
}
export interface Answer { hits: Hit[]; ms: number }
export interface Fault { clip?: string; start: number; stop: number; fault: string; joint?: string | null; [more: string]: unknown }
export interface Annotation {
  id: string; clip: string; kind: string; value: string; from: number | null; to: number | null; who: string;
  made_at: string; undone_at: string | null;
}
export interface ClipAbout extends Omit<ClipRow, "licence"> {
  lineage: Record<string, unknown>; licence: { licences: string[]; dataset: string }; labels: Record<string, unknown>;
  file?: Record<string, unknown>; faults: Fault[]; annotations: Annotation[]; near: Hit[];
}
export interface Span {
  start: number; stop: number; value: string | number | null; colour_index: number; text: string;
  /** Of what a person decided. */
  id?: string; kind?: string;
}
export interface Band { name: string; spans: Span[] }
export interface Timeline { frames: number; fps: number; bands: Band[] }
export interface Skeleton { joints: string[]; parents: number[]; radii: number[] }
export interface MapAnswer {
  ready?: boolean; points: [number, number][]; clips: string[]; values: (string | number | boolean | null)[];
  clusters: { x: number; y: number; text: string; clips: number }[];
}
export interface Suggestion { clip: string; column: string; value: string; confidence: number; near: string[] }
export interface Pair {
  clip: string; other: string; distance: number; mirrored: boolean; offset_seconds: number; overlap_seconds: number;
  decided: string | null;
}
export interface WorstFault extends Fault { clip: string; severity: number | null; decided: string | null }

export class ServiceError extends Error {
  constructor(message: string, readonly status: number) {
    super(message);
  }
}

type Query = Record<string, string | number | boolean | readonly string[] | null | undefined> | URLSearchParams;

function queried(path: string, query?: Query): string {
  const found = query instanceof URLSearchParams ? query : new URLSearchParams();
  if (query && !(query instanceof URLSearchParams)) {
    for (const [name, value] of Object.entries(query)) {
      if (value === null || value === undefined || value === false) continue;
      if (typeof value === "object") for (const one of value) found.append(name, one);
      else found.append(name, String(value));
    }
  }
  const text = found.toString();
  return text ? `/api/${path}?${text}` : `/api/${path}`;
}

async function asked(url: string, init?: RequestInit): Promise<Response> {
  let answer: Response;
  try {
    answer = await fetch(url, { credentials: "same-origin", ...init });
  } catch (error) {
    if ((error as Error).name === "AbortError") throw error;
    throw new ServiceError("The service does not answer. Is motionlake browse still running?", 0);
  }
  if (answer.ok) return answer;
  const said = await answer.json().catch(() => null) as { error?: string; detail?: string } | null;
  const plain = answer.status === 401 ? "No token: open the address that motionlake browse printed." : answer.statusText;
  throw new ServiceError(said?.error ?? plain, answer.status);
}

export async function get<T>(path: string, query?: Query, signal?: AbortSignal): Promise<T> {
  return (await asked(queried(path, query), { signal })).json() as Promise<T>;
}

export async function getBytes(path: string, query?: Query, signal?: AbortSignal): Promise<ArrayBuffer> {
  return (await asked(queried(path, query), { signal })).arrayBuffer();
}

export async function post<T>(path: string, body: unknown, signal?: AbortSignal): Promise<T> {
  const headers = { "Content-Type": "application/json" };
  return (await asked(`/api/${path}`, { method: "POST", headers, body: JSON.stringify(body), signal })).json() as Promise<T>;
}

export async function postFile<T>(path: string, query: Query, file: Blob): Promise<T> {
  const headers = { "Content-Type": "application/octet-stream" };
  return (await asked(queried(path, query), { method: "POST", headers, body: file })).json() as Promise<T>;
}

export async function remove(path: string, query: Query): Promise<void> {
  await asked(queried(path, query), { method: "DELETE" });
}

/** Have the browser keep what the service answers as a file. */
export async function download(path: string, body: unknown, name: string): Promise<number> {
  const headers = { "Content-Type": "application/json" };
  const answer = body === null
    ? await asked(`/api/${path}`)
    : await asked(`/api/${path}`, { method: "POST", headers, body: JSON.stringify(body) });
  const blob = await answer.blob();
  const anchor = document.createElement("a");
  anchor.href = URL.createObjectURL(blob);
  anchor.download = name;
  anchor.click();
  setTimeout(() => URL.revokeObjectURL(anchor.href), 10_000);
  return blob.size;
}
