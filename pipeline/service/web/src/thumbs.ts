/** Short loops of clips, fetched together for what is on the screen, the longest unused forgotten. */
import { getBytes } from "./api";
import { unframed, type Motion } from "./stream";

const AT_ONCE = 48, KEPT = 1500, AT_REST = 15, WAIT = 200, REQUESTS = 2;
const kept = new Map<string, Motion | null>();
const wanted = new Map<string, Set<() => void>>();
const asked = new Set<string>();
let timer: ReturnType<typeof setTimeout> | undefined;

export function thumbnail(clip: string): Motion | null | undefined {
  const found = kept.get(clip);
  if (found !== undefined) { kept.delete(clip); kept.set(clip, found); }
  return found;
}

/** Have a clip's loop fetched; `ready` is called when it is there. The function returned takes the wish back. */
export function want(clip: string, ready: () => void): () => void {
  if (kept.has(clip)) { ready(); return () => undefined; }
  let those = wanted.get(clip);
  if (!those) wanted.set(clip, (those = new Set()));
  those.add(ready);
  later();
  return () => {
    those.delete(ready);
    if (!those.size && wanted.get(clip) === those) wanted.delete(clip);
  };
}

/** Not before scrolling rests: what has left the screen by then is not fetched. */
function later(): void {
  const now = performance.now();
  if (now - latest > 2 * WAIT) begun = now; // the first wishes after a rest are met at once
  latest = now;
  clearTimeout(timer);
  timer = setTimeout(fetchSome, now - begun < 50 ? AT_REST : WAIT);
}
let latest = -Infinity, begun = 0;

const A_FRAME = 8;
const undrawn: (() => void)[] = [];

/** Pictures that come together are drawn some a frame, so that scrolling goes on smoothly. */
function drawSoon(ready: () => void): void {
  if (undrawn.push(ready) === 1) requestAnimationFrame(drawSome);
}
function drawSome(): void {
  for (const ready of undrawn.splice(0, A_FRAME)) ready();
  if (undrawn.length) requestAnimationFrame(drawSome);
}

async function fetchSome(): Promise<void> {
  if (asked.size >= REQUESTS * AT_ONCE) return;
  const clips = [...wanted.keys()].filter((clip) => !asked.has(clip)).slice(-AT_ONCE);
  if (!clips.length) return;
  for (const clip of clips) asked.add(clip);
  let found: (Motion | null)[] = [];
  try {
    found = unframed(await getBytes("thumbnails", { clip: clips }));
  } catch {
    // Shown without pictures; asked for again when the clips come to the screen again.
  }
  clips.forEach((clip, i) => {
    asked.delete(clip);
    const those = wanted.get(clip);
    wanted.delete(clip);
    if (found[i] === undefined) return;
    kept.set(clip, found[i]!);
    those?.forEach(drawSoon);
  });
  for (const clip of kept.keys()) {
    if (kept.size <= KEPT) break;
    kept.delete(clip);
  }
  if (wanted.size) later();
}

export function forgetThumbnails(): void {
  kept.clear();
}
