/** Answers of a search: each with its motion, how far it is, and why. */
import { Button } from "@mantine/core";
import { useEffect, useState } from "react";
import { follow, link } from "./address";
import type { Hit } from "./api";
import { useColours } from "./look";
import { motionOf } from "./motions";
import { decide, lake, selection, toggle, useStore } from "./store";
import type { Motion } from "./stream";
import { Thumb } from "./thumb";

export function hitLink(hit: { clip: string; from?: number | null; to?: number | null }): string {
  return link({ view: "clip", clip: hit.clip, from: hit.from ?? null, to: hit.to ?? null });
}

function methodTitle(name: string): string {
  return lake.get()?.search_methods.find((method) => method.name === name)?.title ?? name;
}

function Why({ hit }: { hit: Hit }): React.JSX.Element {
  const shares = Object.entries(hit.explanation ?? {}).filter(([, v]) => typeof v === "number");
  const joints = Object.entries(hit.joints ?? {}).sort((a, b) => a[1] - b[1]);
  return (
    <div className="why">
      <p>{`Distance ${hit.distance.toPrecision(3)}${hit.mirrored ? ", mirrored left to right" : ""}.`} {shares.length > 0 && "How near it is by each method, from 0 to 1:"}</p>
      {shares.map(([name, near]) => (
        <div key={name} className="share"><span>{methodTitle(name)}</span><meter value={near} max={1} aria-label={name} /><output>{near.toFixed(2)}</output></div>
      ))}
      {joints.length > 0 && <p>{`Most alike: ${joints.slice(0, 3).map(([n]) => n.replace("_", " ")).join(", ")}. Least: ${joints.slice(-3).reverse().map(([n]) => n.replace("_", " ")).join(", ")}.`}</p>}
      {shares.length === 0 && <p>This method gives one number alone: 0 is the same motion.</p>}
    </div>
  );
}

interface HitProps { hit: Hit; index: number; onBeside?: (hit: Hit) => void; judged: boolean }

function HitRow({ hit, index, onBeside, judged }: HitProps): React.JSX.Element {
  const colours = useColours();
  const [pointed, setPointed] = useState(false);
  const [why, setWhy] = useState(false);
  const [verdict, setVerdict] = useState<string | null>(null);
  const [motion, setMotion] = useState<Motion | null | undefined>(undefined);
  const chosen = useStore(selection).has(hit.clip);
  const fixed = useStore(lake)?.read_only ?? false;
  const own = hit.from !== null || hit.mirrored;
  useEffect(() => {
    if (!own) return;
    let live = true;
    setMotion(null);
    motionOf({ clip: hit.clip, from: hit.from, to: hit.to, fps: 15, mirrored: hit.mirrored }).then((found) => { if (live) setMotion(found); }, () => undefined);
    return () => { live = false; };
  }, [hit, own]);
  const judge = (kind: "accept" | "reject") => async () => {
    const text = kind === "accept" ? "Accepted as found." : "Rejected.";
    if (await decide({ clips: [hit.clip], kind, value: hit.label || "found", from: hit.from, to: hit.to }, text)) setVerdict(kind);
  };
  return (
    <li className={`hit${verdict ? ` ${verdict}` : ""}`} onPointerEnter={() => setPointed(true)} onPointerLeave={() => setPointed(false)} onFocus={() => setPointed(true)} onBlur={() => setPointed(false)}>
      <a href={hitLink(hit)} onClick={follow} className="hit-picture"><Thumb clip={hit.clip} width={84} height={76} colours={colours} playing={pointed} motion={own ? motion ?? null : undefined} /></a>
      <div className="hit-text">
        <a href={hitLink(hit)} onClick={follow} title={hit.clip}><b>{index + 1}.</b> {hit.label || "no label"}</a>
        <small className="clip-name" title={hit.clip}><bdi>{hit.clip}</bdi></small>
        <small>{hit.from !== null ? `frames ${hit.from} to ${hit.to}` : "whole clip"}{hit.seconds ? ` · ${hit.seconds.toFixed(1)} s` : ""} · {hit.distance.toPrecision(3)}{hit.mirrored ? " · mirrored" : ""}</small>
        <div className="hit-buttons">
          {onBeside && <Button size="compact-xs" variant="default" onClick={() => onBeside(hit)}>Beside</Button>}
          <Button size="compact-xs" variant="default" aria-expanded={why} onClick={() => setWhy(!why)}>Why</Button>
          <Button size="compact-xs" variant={chosen ? "light" : "default"} aria-pressed={chosen} onClick={() => toggle(hit.clip)}>{chosen ? "Selected" : "Select"}</Button>
          {judged && !fixed && <><Button size="compact-xs" variant="default" aria-label="Accept" aria-pressed={verdict === "accept"} onClick={() => void judge("accept")()}>✓</Button>
            <Button size="compact-xs" variant="default" aria-label="Reject" aria-pressed={verdict === "reject"} onClick={() => void judge("reject")()}>✗</Button></>}
        </div>
        {why && <Why hit={hit} />}
      </div>
    </li>
  );
}

export function Hits({ hits, onBeside, judged = true }: { hits: readonly Hit[]; onBeside?: (hit: Hit) => void; judged?: boolean }): React.JSX.Element {
  return (
    <ol className="hits">
      {hits.map((hit, i) => <HitRow key={`${hit.clip} ${hit.from} ${hit.to} ${hit.mirrored}`} hit={hit} index={i} onBeside={onBeside} judged={judged} />)}
    </ol>
  );
}
