/** Motions of the clips on the page, the last ones kept. */
import { useEffect, useState } from "react";
import { getBytes } from "./api";
import { generation, skeleton, useStore } from "./store";
import { decoded, mirrored, type Motion } from "./stream";

export interface Source { clip?: string; made?: string; upload?: string; from?: number | null; to?: number | null; fps?: number; mirrored?: boolean }

const kept = new Map<string, Promise<Motion | null>>();
const KEPT = 60;

export function keyOf(source: Source): string {
  return JSON.stringify([source.clip, source.made, source.upload, source.from, source.to, source.fps, source.mirrored ?? false]);
}

export function motionOf(source: Source): Promise<Motion | null> {
  const key = `${generation.get()}${keyOf(source)}`;
  let found = kept.get(key);
  if (found) { kept.delete(key); kept.set(key, found); return found; }
  const { clip, made, upload, from, to, fps } = source;
  found = getBytes("clip/motion", { clip, made, upload, from, to, fps }).then((buffer) => {
    const motion = decoded(buffer);
    return motion && source.mirrored ? mirrored(motion, skeleton.get()!.joints) : motion;
  });
  found.catch(() => kept.delete(key));
  kept.set(key, found);
  for (const old of kept.keys()) {
    if (kept.size <= KEPT) break;
    kept.delete(old);
  }
  return found;
}

export interface LoadedMotion { motion: Motion | null; error: string | null }

export function useMotions(sources: readonly Source[]): readonly LoadedMotion[] {
  const keys = `${useStore(generation)}|${sources.map(keyOf).join("|")}`;
  const [state, setState] = useState<{ keys: string; found: readonly LoadedMotion[] }>({ keys: "", found: [] });
  useEffect(() => {
    let live = true;
    const found: LoadedMotion[] = sources.map(() => ({ motion: null, error: null }));
    const tell = (): void => { if (live) setState({ keys, found: [...found] }); };
    sources.forEach((source, i) => {
      motionOf(source).then(
        (motion) => { found[i] = { motion, error: null }; tell(); },
        (error: Error) => { found[i] = { motion: null, error: error.message }; tell(); },
      );
    });
    return () => { live = false; };
    // eslint-disable-next-line react-hooks/exhaustive-deps -- `keys` says what the sources are
  }, [keys]);
  return state.keys === keys ? state.found : NONE;
}
const NONE: readonly LoadedMotion[] = [];
