/** What a person should look at and decide: suggested labels, near-duplicates, faults; and all that was decided. */
import { Button, TextInput } from "@mantine/core";
import { useEffect, useMemo, useState } from "react";
import { AnnotationTable } from "./log";
import { change, follow, link, useAddress } from "./address";
import { get, type ClipAbout, type Pair, type Suggestion, type WorstFault } from "./api";
import { Clock } from "./clock";
import { hitLink } from "./hits";
import { useKeys } from "./keys";
import { useColours } from "./look";
import { useMotions, type Source } from "./motions";
import { Players, type Pane } from "./players";
import type { Shows } from "./scene";
import { decide, decided, generation, lake, undo, useLoaded, useReady, useStore } from "./store";

const SHOWS: Shows = { contacts: true, trails: false, path: false, ground: true };
const TABS = [["suggestions", "Suggested labels"], ["duplicates", "Near-duplicates"], ["faults", "Faults"], ["log", "Decided"]] as const;

/** Two clips, or one, played again and again. */
function Couple({ sources, starts, names }: { sources: Source[]; starts: number[]; names: string[] }): React.JSX.Element {
  const colours = useColours();
  const clock = useMemo(() => new Clock(), []);
  const motions = useMotions(sources);
  const key = JSON.stringify([sources, starts]);
  const panes = useMemo<Pane[]>(() => sources.map((source, i) => ({ key: JSON.stringify(source), motion: motions[i]?.motion ?? null, time: (now) => now + (starts[i] ?? 0) })), [motions, key]); // eslint-disable-line
  useEffect(() => {
    const lengths = panes.map((pane, i) => (pane.motion ? pane.motion.frames / pane.motion.fps - (starts[i] ?? 0) : 0));
    clock.length = Math.max(0.1, ...lengths);
    clock.seek(0);
    clock.play(true);
    return () => clock.stop();
  }, [clock, panes]); // eslint-disable-line
  useKeys([{ keys: "Space", does: "Play or stop", act: () => clock.play(!clock.playing.get()) }]);
  return (
    <div className="stage-box">
      <Players panes={panes} clock={clock} shows={SHOWS} follow colours={colours} label={`Motion of ${names.join(" and ")}`} />
      <div className="pane-names" style={{ gridTemplateColumns: `repeat(${sources.length}, 1fr)` }}>
        {names.map((name, i) => <div key={i}><span className="pane-name">{name}</span></div>)}
      </div>
    </div>
  );
}

interface QueueProps<T> {
  items: T[]; empty: string; name: (item: T) => string; line: (item: T) => string; sub: (item: T) => string; note: (item: T) => string;
  children: (item: T, next: () => void) => React.ReactNode;
}

function Queue<T>({ items, empty, name, line, sub, note, children }: QueueProps<T>): React.JSX.Element {
  const [current, setCurrent] = useState(0);
  const place = Math.min(current, Math.max(0, items.length - 1));
  const item = items[place];
  useEffect(() => { document.getElementById(`queue-${place}`)?.scrollIntoView({ block: "nearest" }); }, [place]);
  useKeys([
    { keys: "j / ArrowDown", does: "The next one", act: () => setCurrent(Math.min(items.length - 1, place + 1)) },
    { keys: "k / ArrowUp", does: "The one before", act: () => setCurrent(Math.max(0, place - 1)) },
    { keys: "u / Ctrl+z", does: "Undo the last decision", act: () => void undo() },
  ]);
  if (!item) return <p className="message">{empty}</p>;
  return (
    <div className="review">
      <ol className="queue">
        {items.map((one, i) => (
          <li key={name(one)} id={`queue-${i}`}>
            <button type="button" aria-current={i === place} onClick={() => setCurrent(i)}><span>{line(one)}</span><small>{note(one)}</small><small title={name(one)} className="sub">{sub(one)}</small></button>
          </li>
        ))}
      </ol>
      <div className="judge">{children(item, () => setCurrent(Math.min(items.length - 1, place + 1)))}</div>
    </div>
  );
}

function Suggestions(): React.JSX.Element {
  const version = useStore(generation) + useStore(decided);
  const fixed = useStore(lake)?.read_only ?? false;
  const found = useReady<{ ready?: boolean; items: Suggestion[] }>(`${version}`, (signal) => get("suggestions", { k: 50 }, signal));
  if (found.error) return <p className="message" role="alert">{found.error}</p>;
  if (found.waiting || !found.value) return <p className="message" role="status">Looking for the clips whose label would teach most. This takes a moment the first time.</p>;
  return (
    <Queue items={found.value.items} empty="No clip waits for a label." name={(one) => one.clip} line={(one) => `${one.value}?`} sub={(one) => one.clip} note={(one) => `${Math.round(100 * one.confidence)}% sure`}>
      {(one) => <Suggested key={one.clip} one={one} fixed={fixed} />}
    </Queue>
  );
}

function Suggested({ one, fixed }: { one: Suggestion; fixed: boolean }): React.JSX.Element {
  const [other, setOther] = useState("");
  const accept = (): void => { if (!fixed) void decide({ clips: [one.clip], kind: "accept", value: one.value }, `${one.value}: accepted.`); };
  const reject = (): void => { if (!fixed) void decide({ clips: [one.clip], kind: "reject", value: one.value }, `${one.value}: rejected.`); };
  useKeys([
    { keys: "y / a", does: "Accept the suggested label", act: accept },
    { keys: "x", does: "Reject it", act: reject },
    { keys: "l", does: "Write another label", act: () => document.querySelector<HTMLInputElement>(".judge input")?.focus() },
  ]);
  const near = one.near[0];
  const sources = useMemo(() => [{ clip: one.clip }, ...(near ? [{ clip: near }] : [])], [one.clip, near]);
  return (
    <>
      <h2>Is this “{one.value}”?</h2>
      <Couple sources={sources} starts={[0, 0]} names={[`${one.clip}: no label yet`, ...(near ? [`${near}: ${one.value}`] : [])]} />
      <div className="judge-buttons">
        <Button onClick={accept} disabled={fixed}>Accept (y)</Button>
        <Button variant="default" onClick={reject} disabled={fixed}>Reject (x)</Button>
        <form className="judge-buttons" onSubmit={(event) => { event.preventDefault(); if (other.trim()) void decide({ clips: [one.clip], kind: "label", value: other.trim() }, `Labelled ${other.trim()}.`); }}>
          <TextInput value={other} onChange={(event) => setOther(event.currentTarget.value)} placeholder="Another label (l)" aria-label="Another label" maxLength={200} disabled={fixed} />
          <Button variant="default" type="submit" disabled={fixed || !other.trim()}>Label</Button>
        </form>
        <a href={link({ view: "clip", clip: one.clip, beside: near })} onClick={follow}>Open both</a>
      </div>
      <p className="note">{near ? `The right one is the labelled clip that suggests it. ` : ""}The queue begins with the clips whose answer would teach most.</p>
    </>
  );
}

function Duplicates(): React.JSX.Element {
  const version = useStore(generation) + useStore(decided);
  const found = useReady<{ ready?: boolean; pairs: Pair[] }>(`${version}`, (signal) => get("duplicates", { k: 200 }, signal));
  if (found.error) return <p className="message" role="alert">{found.error}</p>;
  if (found.waiting || !found.value) return <p className="message" role="status">Comparing clips. This takes a moment the first time.</p>;
  return (
    <Queue items={found.value.pairs} empty="No two clips are one recording." name={(one) => `${one.clip} and ${one.other}`} line={(one) => tail(one.clip)} sub={(one) => `and ${tail(one.other)}`}
      note={(one) => one.decided ?? `${(100 * one.distance).toFixed(1)}% differs`}>
      {(one, next) => <Duplicated key={`${one.clip} ${one.other}`} one={one} next={next} />}
    </Queue>
  );
}

function Duplicated({ one, next }: { one: Pair; next: () => void }): React.JSX.Element {
  const fixed = useStore(lake)?.read_only ?? false;
  const say = (how: "same" | "different") => async () => {
    if (!fixed && await decide({ clips: [one.clip], kind: "duplicate", value: `${how}:${one.other}` }, how === "same" ? "One recording." : "Two recordings.")) next();
  };
  useKeys([
    { keys: "y / s", does: "They are one recording", act: () => void say("same")() },
    { keys: "x / d", does: "They are two", act: () => void say("different")() },
  ]);
  const sources = useMemo(() => [{ clip: one.clip }, { clip: one.other, mirrored: one.mirrored }], [one]);
  const later = one.offset_seconds;
  return (
    <>
      <h2>Are these one recording?</h2>
      <Couple sources={sources} starts={[Math.max(0, -later), Math.max(0, later)]} names={[one.clip, `${one.other}${one.mirrored ? ", shown mirrored" : ""}`]} />
      <div className="judge-buttons">
        <Button onClick={() => void say("same")()} disabled={fixed}>One recording (y)</Button>
        <Button variant="default" onClick={() => void say("different")()} disabled={fixed}>Two (x)</Button>
        {one.decided && <span>Decided: {one.decided}</span>}
        <a href={link({ view: "clip", clip: one.clip, beside: one.other, beside_mirrored: one.mirrored ? "1" : "" })} onClick={follow}>Open both</a>
      </div>
      <p className="note">{`They are shown in step: ${one.overlap_seconds.toFixed(1)} s of both show the same; ${(100 * one.distance).toFixed(1)}% of the movement differs.`}</p>
    </>
  );
}

function plainly(one: WorstFault): string {
  return `${one.fault}${one.joint ? `, ${one.joint}` : ""}`.replaceAll("_", " ");
}

function tail(clip: string): string {
  return clip.split("/").slice(-2).join("/");
}

function Faults(): React.JSX.Element {
  const version = useStore(generation) + useStore(decided);
  const found = useLoaded<{ ready?: boolean; faults: WorstFault[] }>(`${version}`, (signal) => get("faults", { k: 200 }, signal));
  if (found.error) return <p className="message" role="alert">{found.error}</p>;
  if (!found.value) return <p className="message" role="status">Reading.</p>;
  if (found.value.ready === false) return <p className="message">The stage quality has not run. It looks for what no body did: motionlake run quality.</p>;
  return (
    <Queue items={found.value.faults} empty="Nothing unusual was found in any clip." name={(one) => `${one.clip}, frames ${one.start} to ${one.stop}, ${one.joint ?? ""}`}
      line={plainly} sub={(one) => `frames ${one.start} to ${one.stop} of ${tail(one.clip)}`} note={(one) => one.decided ?? (one.severity != null ? one.severity.toFixed(1) : "")}>
      {(one, next) => <Faulty key={`${one.clip} ${one.start} ${one.fault} ${one.joint}`} one={one} next={next} />}
    </Queue>
  );
}

function Faulty({ one, next }: { one: WorstFault; next: () => void }): React.JSX.Element {
  const fixed = useStore(lake)?.read_only ?? false;
  const about = useLoaded<ClipAbout>(one.clip, (signal) => get("clip", { clip: one.clip }, signal));
  const fps = about.value?.fps ?? 30, frames = about.value?.frames ?? one.stop;
  const margin = Math.round(fps);
  const source = useMemo(() => [{ clip: one.clip, from: Math.max(0, one.start - margin), to: Math.min(frames, one.stop + margin) }], [one, margin, frames]);
  const say = (how: "true" | "false") => async () => {
    const value = `${how}:${one.fault}`;
    if (!fixed && await decide({ clips: [one.clip], kind: "fault", value, from: one.start, to: one.stop }, how === "true" ? "A fault." : "No fault.")) next();
  };
  useKeys([
    { keys: "y", does: "It is a fault", act: () => void say("true")() },
    { keys: "x", does: "It is none", act: () => void say("false")() },
  ]);
  return (
    <>
      <h2>Is this a fault: {plainly(one)}?</h2>
      {about.value && <Couple sources={source} starts={[0]} names={[`${one.clip}, frames ${one.start} to ${one.stop} and a second around`]} />}
      <div className="judge-buttons">
        <Button onClick={() => void say("true")()} disabled={fixed}>A fault (y)</Button>
        <Button variant="default" onClick={() => void say("false")()} disabled={fixed}>No fault (x)</Button>
        {one.decided && <span>Decided: {one.decided === "true" ? "a fault" : "no fault"}</span>}
        <a href={hitLink({ clip: one.clip, from: one.start, to: one.stop })} onClick={follow}>Open the clip</a>
      </div>
    </>
  );
}

export default function WorkPage(): React.JSX.Element {
  const at = useAddress();
  const tab = at.get("tab") ?? "suggestions";
  return (
    <main className="work">
      <div className="tabs" role="tablist">
        {TABS.map(([name, title]) => <button key={name} type="button" role="tab" aria-selected={tab === name} onClick={() => change({ tab: name === "suggestions" ? null : name })}>{title}</button>)}
      </div>
      {tab === "duplicates" ? <Duplicates /> : tab === "faults" ? <Faults /> : tab === "log" ? <AnnotationTable /> : <Suggestions />}
    </main>
  );
}
