/** One clip: its players, its timeline, its curves, what is like it, what is known of it. */
import { Button, Checkbox, NativeSelect } from "@mantine/core";
import { useCallback, useEffect, useMemo, useRef, useState } from "react";
import { About } from "./about";
import { change, numberAt, useAddress } from "./address";
import { get, type ClipAbout, type Hit, type Span, type Timeline as TimelineAnswer } from "./api";
import { Clock, SPEEDS } from "./clock";
import { PALETTE } from "./colours";
import { Curve } from "./curves";
import { ExportDialog, LabelDialog, MakeDialog } from "./dialogs";
import { Find } from "./find";
import { useKeys } from "./keys";
import { useColours } from "./look";
import { useMotions, type Source } from "./motions";
import { Players, type Pane } from "./players";
import type { Shows, Stage } from "./scene";
import { complain, decide, decided, generation, lake, skeleton, undo, useLoaded, useStore } from "./store";
import { saidAt, Timeline, type Range } from "./timeline";

type Path = [number, number][];

/** The frame of the other clip that belongs to a frame, along a path of alignment. */
export function along(path: Path, frame: number): number {
  let low = 0, high = path.length - 1;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (path[middle]![0] < frame) low = middle + 1; else high = middle;
  }
  const [i, j] = path[low]!;
  const before = path[Math.max(0, low - 1)]!;
  if (frame >= i) return j + (low === path.length - 1 ? frame - i : 0);
  if (low === 0) return j - (i - frame);
  const share = (frame - before[0]) / Math.max(1, i - before[0]);
  return before[1] + share * (j - before[1]);
}

interface Other { clip?: string; made?: string; from: number | null; to: number | null; mirrored: boolean }

function othersOf(at: URLSearchParams): Other[] {
  const spans = at.getAll("beside_at"), turned = at.getAll("beside_mirrored");
  const beside = at.getAll("beside").map((clip, i) => {
    const [from, to] = (spans[i] || "").split("-").map((text) => (text ? Number(text) : null));
    return { clip, from: from ?? null, to: to ?? null, mirrored: turned[i] === "1" };
  });
  return [...beside, ...at.getAll("made").map((made) => ({ made, from: null, to: null, mirrored: false }))].slice(0, 3);
}

function othersAs(others: Other[]): Record<string, string[]> {
  const clips = others.filter((one) => one.clip);
  return {
    beside: clips.map((one) => one.clip!), beside_at: clips.map((one) => (one.from === null ? "" : `${one.from}-${one.to}`)),
    beside_mirrored: clips.map((one) => (one.mirrored ? "1" : "")), made: others.filter((one) => one.made).map((one) => one.made!),
  };
}

function useSegments(timeline: TimelineAnswer | null): Span[] | null {
  return useMemo(() => {
    const found = [...(timeline?.bands.find((band) => band.name === "segments")?.spans ?? [])];
    // What people decided is put in the place of the segment of the same label that it overlaps most.
    for (const span of timeline?.bands.find((band) => band.name === "annotations")?.spans ?? []) {
      if (span.kind !== "segment") continue;
      const shared = (one: Span): number => (one.value === span.value ? Math.min(one.stop, span.stop) - Math.max(one.start, span.start) : 0);
      const place = found.reduce((best, one, i) => (shared(one) > (best < 0 ? 0 : shared(found[best]!)) ? i : best), -1);
      if (place < 0) found.push(span); else found[place] = span;
    }
    return found.length ? found.sort((a, b) => a.start - b.start) : null;
  }, [timeline]);
}

function Now({ clock, timeline, frames, fps }: { clock: Clock; timeline: TimelineAnswer | null; frames: number; fps: number }): React.JSX.Element {
  const box = useRef<HTMLOutputElement>(null);
  const scrub = useRef<HTMLInputElement>(null);
  useEffect(() => {
    const draw = (): void => {
      const frame = Math.min(frames - 1, Math.floor(clock.now * fps + 1e-6));
      const said = timeline ? saidAt(timeline.bands.filter((band) => !["motifs", "symbols", "contacts"].includes(band.name)), frame) : "";
      if (box.current) box.current.textContent = `${clock.now.toFixed(2)} s, frame ${frame} of ${frames}${said ? ` · ${said}` : ""}`;
      if (scrub.current) scrub.current.value = String(frame);
    };
    draw();
    return clock.subscribe(draw);
  }, [clock, timeline, frames, fps]);
  return (
    <>
      <input ref={scrub} type="range" className="scrub" min={0} max={Math.max(0, frames - 1)} defaultValue={0} aria-label="Moment"
        onInput={(event) => { clock.playing.set(false); clock.seek(Number(event.currentTarget.value) / fps); }} />
      <output ref={box} className="now" />
    </>
  );
}

export default function ClipPage(): React.JSX.Element {
  const at = useAddress();
  const colours = useColours();
  const clip = at.get("clip") ?? "";
  const version = useStore(generation) + useStore(decided);
  const readOnly = useStore(lake)?.read_only ?? false;
  const about = useLoaded<ClipAbout>(`${version} ${clip}`, (signal) => get("clip", { clip }, signal));
  const near = useLoaded<ClipAbout>(`${version} ${clip}`, (signal) => get("clip", { clip, near: 8 }, signal));
  const timeline = useLoaded<TimelineAnswer>(`${version} ${clip}`, (signal) => get("clip/timeline", { clip }, signal));
  const others = useMemo(() => othersOf(at), [at]);
  const otherKey = JSON.stringify(others);
  const sources = useMemo<Source[]>(() => [{ clip }, ...others.map(({ clip: name, made, mirrored }) => ({ clip: name, made, mirrored }))], [clip, otherKey]); // eslint-disable-line
  const motions = useMotions(sources);
  const others_about = useLoaded<(ClipAbout | null)[]>(`${otherKey}`, (signal) => Promise.all(others.map((other) => (other.clip ? get<ClipAbout>("clip", { clip: other.clip }, signal) : null))));
  const first = about.value?.clip === clip ? about.value : null;
  const frames = first?.frames ?? timeline.value?.frames ?? 1, fps = first?.fps ?? timeline.value?.fps ?? 30;

  const clock = useMemo(() => new Clock(), []);
  const playing = useStore(clock.playing), speed = useStore(clock.speed);
  const stage = useRef<Stage | null>(null);
  const [followed, setFollowed] = useState(true);
  const [shows, setShows] = useState<Shows>({ contacts: true, trails: false, path: true, ground: true });
  const [tab, setTab] = useState<"find" | "about">("find");
  const [open, setOpen] = useState<"tag" | "label" | "segment" | "export" | "make" | null>(null);
  const [asked, setAsked] = useState(0);
  const [joint, setJoint] = useState(() => Math.max(0, skeleton.get()!.joints.indexOf("right_wrist")));

  // The marked range lies in the address once it is whole.
  const [draft, setDraft] = useState<Range | null>(null);
  const from = numberAt(at, "from"), to = numberAt(at, "to");
  const marked = useMemo<Range | null>(() => (from !== null && to !== null && from < to ? { from, to: first ? Math.min(to, frames) : to } : null), [from, to, first, frames]);
  const range = draft ?? marked;
  const onRange = useCallback((next: Range | null, done: boolean) => {
    setDraft(done ? null : next);
    if (done) change({ from: next?.from ?? null, to: next?.to ?? null }, true);
  }, []);

  useEffect(() => () => clock.stop(), [clock]);
  useEffect(() => {
    clock.length = frames / fps;
    clock.fps = fps;
  }, [clock, frames, fps]);
  useEffect(() => {
    clock.from = marked ? marked.from / fps : 0;
    clock.to = marked ? marked.to / fps : Infinity;
    if (marked && (clock.now < clock.from || clock.now > clock.to)) clock.seek(clock.from);
  }, [clock, marked, fps]);
  useEffect(() => { clock.seek(marked ? marked.from / fps : 0); }, [clip]); // eslint-disable-line
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  useEffect(() => { if (!still) clock.play(true); }, [clip]); // eslint-disable-line

  const aligned = at.has("aligned");
  const paths = useLoaded<(Path | null)[]>(aligned && others.length ? `${clip} ${otherKey} ${from} ${to}` : null, (signal) =>
    Promise.all(others.map((other) => (other.clip ? get<{ path: Path }>("align", { clip, other: other.clip, from: marked?.from, to: marked?.to, other_from: other.from, other_to: other.to }, signal).then((a) => (a.path.length ? a.path : null)) : null))));
  useEffect(() => { if (paths.error) complain(paths.error); }, [paths.error]);
  const times = useMemo(() => {
    const start = marked ? marked.from / fps : 0;
    return [(now: number) => now, ...others.map((other, i) => {
      const rate = others_about.value?.[i]?.fps ?? 30;
      const path = aligned ? paths.value?.[i] : null;
      if (path) return (now: number) => along(path, now * fps) / rate;
      const begin = other.from === null ? 0 : other.from / rate;
      return (now: number) => now - start + begin;
    })];
  }, [marked, fps, otherKey, others_about.value, aligned, paths.value]); // eslint-disable-line
  const panes = useMemo<Pane[]>(() => sources.map((source, i) => ({ key: JSON.stringify(source), motion: motions[i]?.motion ?? null, time: times[i] ?? times[0]! })), [sources, motions, times]);
  useEffect(clock.redraw, [clock, panes]);

  const beside = useCallback((hit: Hit) => {
    const next = [...others, { clip: hit.clip, from: hit.from, to: hit.to, mirrored: hit.mirrored }].slice(-3);
    change(othersAs(next));
  }, [otherKey]); // eslint-disable-line

  const segments = useSegments(timeline.value);
  const [editing, setEditing] = useState<Span[] | null>(null);
  // Edges that were moved are kept when they rest; each correction takes the place of the one before.
  const moved = useRef(new Map<number, Span>()), kept = useRef(new Map<number, string>());
  const saving = useRef(Promise.resolve()), timer = useRef<ReturnType<typeof setTimeout>>(undefined), busy = useRef(0);
  useEffect(() => {
    if (moved.current.size || busy.current) return;
    kept.current.clear();
    setEditing((now) => (now ? segments ?? [] : null));
  }, [segments]);
  useEffect(() => setEditing(null), [clip]);
  const keep = (): void => {
    for (const [i, span] of moved.current) {
      const old = segments?.[i], value = String(span.value ?? span.text);
      busy.current++;
      saving.current = saving.current.then(async () => {
        const before = kept.current.get(i) ?? old?.id;
        const text = `Segment ${value}: frames ${span.start} to ${span.stop}.`;
        const ids = await decide({ clips: [clip], kind: "segment", value, from: span.start, to: span.stop }, text, before ? [before] : []);
        if (ids) kept.current.set(i, ids[0]!);
        busy.current--;
      });
    }
    moved.current.clear();
  };
  const onEdges = (next: Span[], changed: number[], done: boolean): void => {
    setEditing(next);
    if (!done) return;
    for (const i of changed) moved.current.set(i, next[i]!);
    clearTimeout(timer.current);
    timer.current = setTimeout(keep, 400);
  };

  const edges = useMemo(() => [...new Set((segments ?? []).flatMap((span) => [span.start, span.stop]))].sort((a, b) => a - b), [segments]);
  const jump = (way: 1 | -1): void => {
    const here = clock.frame;
    const next = way > 0 ? edges.find((edge) => edge > here) : edges.findLast((edge) => edge < here);
    if (next !== undefined) clock.seek(next / fps);
  };
  const flip = (name: keyof Shows) => () => setShows((now) => ({ ...now, [name]: !now[name] }));
  const mark = (end: "from" | "to") => (): void => {
    const here = clock.frame;
    const next = end === "from" ? { from: here, to: range && range.to > here ? range.to : frames } : { from: range && range.from < here ? range.from : 0, to: Math.max(1, here) };
    onRange(next, true);
  };
  const faster = (by: number): void => clock.speed.set(SPEEDS[Math.min(SPEEDS.length - 1, Math.max(0, SPEEDS.indexOf(speed as 1) + by))]!);
  const decideKey = (what: typeof open) => () => { if (!readOnly || what === "export" || what === "make") setOpen(what); };
  useKeys([
    { keys: "Space / k", does: "Play or stop", act: () => clock.play(!clock.playing.get()) },
    { keys: "ArrowLeft / ArrowRight", does: "One frame back or on", act: (e) => clock.step(e.key === "ArrowLeft" ? -1 : 1) },
    { keys: "Shift+ArrowLeft / Shift+ArrowRight", does: "One second back or on", act: (e) => clock.step((e.key === "ArrowLeft" ? -1 : 1) * Math.round(fps)) },
    { keys: "Home / End", does: "To the beginning or the end", act: (e) => clock.seek(e.key === "Home" ? 0 : clock.length) },
    { keys: ", / .", does: "To the edge of a segment before or after", act: (e) => jump(e.key === "," ? -1 : 1) },
    { keys: "< / >", does: "Slower or faster", act: (e) => faster(e.key === "<" ? -1 : 1) },
    { keys: "[ / ]", does: "Mark the first or last moment of a range", act: (e) => mark(e.key === "[" ? "from" : "to")() },
    { keys: "Escape", does: "Mark no range", act: () => onRange(null, true) },
    { keys: "Enter / s", does: "Find what is marked, or clips like this", act: () => { setTab("find"); setAsked((n) => n + 1); } },
    { keys: "f", does: "Follow the body, or stand still", act: () => setFollowed(!followed) },
    { keys: "c", does: "Show which foot stands", act: flip("contacts") },
    { keys: "r", does: "Show trails of hands and feet", act: flip("trails") },
    { keys: "g", does: "Show the ground", act: flip("ground") },
    { keys: "h", does: "Look from where it began", act: () => { stage.current?.home(); clock.redraw(); } },
    { keys: "+ / - / =", does: "Nearer or farther", act: (e) => { stage.current?.zoom(e.key === "-" ? 1 / 1.15 : 1.15); clock.redraw(); } },
    { keys: "a", does: "Align clips side by side in time", act: () => change({ aligned: !aligned }, true) },
    { keys: "t", does: "Tag this clip", act: decideKey("tag") },
    { keys: "l", does: "Label this clip", act: decideKey("label") },
    { keys: "n", does: "Name the marked range as a segment", act: () => { if (range && !readOnly) setOpen("segment"); } },
    { keys: "w", does: "Correct the edges of segments", act: () => { if (!readOnly && segments) setEditing(editing ? null : segments); } },
    { keys: "e", does: "Export this clip, or the marked range", act: decideKey("export") },
    { keys: "m", does: "Make new motion like this", act: decideKey("make") },
    { keys: "u / Ctrl+z", does: "Undo the last decision", act: () => void undo() },
    { keys: "i", does: "Find, or what is known of it", act: () => setTab(tab === "find" ? "about" : "find") },
  ]);

  if (about.error) return <main><p className="message" role="alert">{about.error}</p></main>;
  const problem = motions.find((one) => one.error)?.error;
  const count = sources.length, columns = count === 4 ? 2 : count;
  const cut = range ? { from: range.from, to: range.to } : { from: null, to: null };
  const joints = skeleton.get()!.joints;
  const length = frames / fps;
  return (
    <main className="clip-page">
      <section className="theatre" aria-label="Player">
        <div className="theatre-head">
          <h1 title={clip}>{first?.label || (first ? "no label" : "")} <span>{clip}</span></h1>
          <Button size="compact-xs" variant="default" disabled={readOnly} onClick={decideKey("tag")}>Tag</Button>
          <Button size="compact-xs" variant="default" disabled={readOnly} onClick={decideKey("label")}>Label</Button>
          <Button size="compact-xs" variant="default" onClick={decideKey("export")}>{range ? "Cut and export" : "Export"}</Button>
          <Button size="compact-xs" variant="default" onClick={decideKey("make")}>Make like this</Button>
        </div>
        <div className="stage-box">
          <Players panes={panes} clock={clock} shows={shows} follow={followed} colours={colours} stageRef={stage} label={`Motion of ${[clip, ...others.map((o) => o.clip ?? "made motion")].join(" and ")}`} />
          {problem && <p className="message" role="alert">{problem}</p>}
          {count > 1 && (
            <div className="pane-names" style={{ gridTemplateColumns: `repeat(${columns}, 1fr)` }}>
              {sources.map((source, i) => (
                <div key={i}>
                  <span className="pane-name"><i style={{ background: i ? PALETTE[i] : "var(--ink)" }} />{i ? others_about.value?.[i - 1]?.label || (source.made ? "made motion" : "no label") : first?.label || "no label"}{source.mirrored ? ", mirrored" : ""} <small>{source.clip}</small></span>
                  {i > 0 && <button type="button" className="plain" aria-label={`Remove ${source.clip ?? source.made}`} onClick={() => change(othersAs(others.filter((_, n) => n !== i - 1)))}>✕</button>}
                </div>
              ))}
            </div>
          )}
        </div>
        <div className="transport">
          <Button size="xs" className="play" onClick={() => clock.play(!playing)}>{playing ? "Stop" : "Play"}</Button>
          <Now clock={clock} timeline={timeline.value} frames={frames} fps={fps} />
        </div>
        <div className="transport options">
          <NativeSelect size="xs" aria-label="Speed" value={String(speed)} data={SPEEDS.map((s) => ({ value: String(s), label: `${s}×` }))} onChange={(e) => clock.speed.set(Number(e.currentTarget.value))} />
          <Checkbox size="xs" label="Follow" checked={followed} onChange={() => setFollowed(!followed)} />
          <Checkbox size="xs" label="Feet" checked={shows.contacts} onChange={flip("contacts")} />
          <Checkbox size="xs" label="Trails" checked={shows.trails} onChange={flip("trails")} />
          <Checkbox size="xs" label="Ground" checked={shows.ground} onChange={flip("ground")} />
          <Checkbox size="xs" label="Align in time" checked={aligned} disabled={!others.some((o) => o.clip)} onChange={() => change({ aligned: !aligned }, true)} />
          <span className="spring" />
          <Button size="compact-xs" variant="default" disabled={!range || readOnly} onClick={() => setOpen("segment")}>Name range</Button>
          <Button size="compact-xs" variant={editing ? "light" : "default"} disabled={readOnly || !segments} aria-pressed={Boolean(editing)} onClick={() => setEditing(editing ? null : segments)}>Correct segments</Button>
          <Button size="compact-xs" variant="default" disabled={!range} onClick={() => onRange(null, true)}>Unmark</Button>
        </div>
        <Timeline timeline={timeline.value} frames={frames} fps={fps} clock={clock} colours={colours} range={range} onRange={onRange} editing={editing} onEdges={onEdges} />
        <div className="curves">
          <NativeSelect size="xs" aria-label="Joint" value={String(joint)} onChange={(e) => setJoint(Number(e.currentTarget.value))} data={joints.map((name, j) => ({ value: String(j), label: name.replace("_", " ") }))} />
          <div className="curve-box"><Curve motions={panes.map((p) => p.motion)} times={times} joint={joint} measure="height" clock={clock} colours={colours} length={length} /></div>
          <div className="curve-box"><Curve motions={panes.map((p) => p.motion)} times={times} joint={joint} measure="speed" clock={clock} colours={colours} length={length} /></div>
        </div>
      </section>
      <aside>
        <div className="tabs" role="tablist">
          {(["find", "about"] as const).map((name) => (
            <button key={name} type="button" role="tab" aria-selected={tab === name} onClick={() => setTab(name)}>{name === "find" ? "Find" : "About"}</button>
          ))}
        </div>
        <div className="side" hidden={tab !== "find"}><Find clip={clip} range={range} fps={fps} onBeside={beside} first={near.value?.clip === clip ? near.value.near : undefined} asked={asked} /></div>
        <div className="side" hidden={tab !== "about"}>{first && <About about={first} onSeek={(frame) => clock.seek(frame / fps)} />}</div>
      </aside>
      {(open === "tag" || open === "label") && <LabelDialog kind={open} clips={[clip]} onClose={() => setOpen(null)} />}
      {open === "segment" && range && <LabelDialog kind="segment" clips={[clip]} from={range.from} to={range.to} onClose={() => setOpen(null)} />}
      {open === "export" && <ExportDialog clips={[{ clip, ...cut }]} onClose={() => setOpen(null)} />}
      {open === "make" && <MakeDialog like={[clip]} onClose={() => setOpen(null)} />}
    </main>
  );
}
