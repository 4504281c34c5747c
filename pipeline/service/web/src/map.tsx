/** All clips as points: those that move alike lie together. */
import { Button, Checkbox, NativeSelect } from "@mantine/core";
import { useEffect, useMemo, useRef, useState } from "react";
import { change, go, useAddress } from "./address";
import { get, type MapAnswer } from "./api";
import { PALETTE, shade } from "./colours";
import { sized } from "./figure";
import { useKeys } from "./keys";
import { counted, useColours } from "./look";
import { SelectionBar } from "./selection";
import { decided, generation, select, selection, useReady, useStore } from "./store";
import { Thumb } from "./thumb";

const COLUMNS = [["label", "Label"], ["dataset", "Dataset"], ["subject", "Subject"], ["rig", "Rig"], ["seconds", "Length"], ["quality", "Quality"], ["synthetic", "Synthetic"], ["licence", "Licence"], ["tags", "Tags"]] as const;
type Shape = "circle" | "square" | "triangle";
const SHAPES: readonly Shape[] = ["circle", "square", "triangle"];
const NOTHING = "none";

interface Look { colour: string; shape: Shape; name: string; clips: number }

/** A colour and a shape for each value: the most frequent 18 apart, the rest together. */
function looksOf(values: MapAnswer["values"], dark: boolean): { looks: Look[]; of: Uint8Array; numeric: [number, number] | null } {
  const of = new Uint8Array(values.length);
  const numbers = values.filter((v): v is number => typeof v === "number");
  if (numbers.length && numbers.length === values.filter((v) => v !== null).length) {
    const sorted = [...numbers].sort((a, b) => a - b);
    const low = sorted[Math.floor(0.02 * sorted.length)]!, high = sorted[Math.floor(0.98 * (sorted.length - 1))]!;
    const looks = Array.from({ length: 12 }, (_, i) => ({ colour: shade(dark ? 0.15 + 0.85 * (i / 11) : i / 11), shape: "circle" as const, name: "", clips: 0 }));
    values.forEach((v, i) => { of[i] = typeof v === "number" ? Math.max(0, Math.min(11, Math.floor((12 * (v - low)) / Math.max(1e-9, high - low)))) : 0; });
    return { looks, of, numeric: [low, high] };
  }
  const counts = new Map<string, number>();
  const text = (v: MapAnswer["values"][number]): string => (v === null || v === "" ? NOTHING : String(v));
  for (const v of values) counts.set(text(v), (counts.get(text(v)) ?? 0) + 1);
  const names = [...counts.keys()].filter((name) => name !== NOTHING).sort((a, b) => counts.get(b)! - counts.get(a)! || (a < b ? -1 : 1));
  const shown = names.slice(0, 18);
  const looks: Look[] = shown.map((name, i) => ({ colour: PALETTE[i % 6]!, shape: SHAPES[Math.floor(i / 6)]!, name, clips: counts.get(name)! }));
  const rest = names.slice(18).reduce((sum, name) => sum + counts.get(name)!, 0);
  const grey = dark ? "#7d848b" : "#a8adb3";
  if (rest) looks.push({ colour: grey, shape: "square", name: `${names.length - 18} others`, clips: rest });
  if (counts.has(NOTHING)) looks.push({ colour: grey, shape: "circle", name: NOTHING, clips: counts.get(NOTHING)! });
  const place = new Map(shown.map((name, i) => [name, i]));
  const last = looks.length - 1, others = counts.has(NOTHING) ? last - 1 : last;
  values.forEach((v, i) => { const name = text(v); of[i] = place.get(name) ?? (name === NOTHING ? last : others); });
  return { looks, of, numeric: null };
}

function dot(ctx: CanvasRenderingContext2D, shape: Shape, x: number, y: number, r: number): void {
  if (shape === "circle") { ctx.moveTo(x + r, y); ctx.arc(x, y, r, 0, 7); }
  else if (shape === "square") ctx.rect(x - r, y - r, 2 * r, 2 * r);
  else { ctx.moveTo(x, y - 1.2 * r); ctx.lineTo(x + 1.15 * r, y + r); ctx.lineTo(x - 1.15 * r, y + r); ctx.closePath(); }
}

function inside(polygon: readonly [number, number][], x: number, y: number): boolean {
  let found = false;
  for (let i = 0, j = polygon.length - 1; i < polygon.length; j = i++) {
    const [ax, ay] = polygon[i]!, [bx, by] = polygon[j]!;
    if (ay > y !== by > y && x < ((bx - ax) * (y - ay)) / (by - ay) + ax) found = !found;
  }
  return found;
}

export default function MapPage(): React.JSX.Element {
  const at = useAddress();
  const colours = useColours();
  const column = at.get("colour") ?? "label";
  const version = useStore(generation) + useStore(decided);
  const map = useReady<MapAnswer>(`${version} ${column}`, (signal) => get("map", { colour: column }, signal));
  const answer = map.value?.points.length ? map.value : null;
  const chosen = useStore(selection);
  const canvas = useRef<HTMLCanvasElement>(null);
  const view = useRef({ x: 0, y: 0, zoom: 1 });
  const lasso = useRef<[number, number][] | null>(null);
  const [pan, setPan] = useState(false);
  const [names, setNames] = useState(true);
  const [tip, setTip] = useState<{ i: number; x: number; y: number } | null>(null);
  const about = useMemo(() => (answer ? looksOf(answer.values, colours.dark) : null), [answer, colours.dark]);
  const draw = useRef<() => void>(() => undefined);
  const asked = useRef(0);
  const redraw = (): void => { if (!asked.current) asked.current = requestAnimationFrame(() => { asked.current = 0; draw.current(); }); };

  const lens = (): { scale: number; ox: number; oy: number } => {
    const box = canvas.current!;
    const scale = 0.46 * Math.min(box.clientWidth, box.clientHeight) * view.current.zoom;
    return { scale, ox: box.clientWidth / 2 - view.current.x * scale, oy: box.clientHeight / 2 + view.current.y * scale };
  };

  draw.current = () => {
    const box = canvas.current;
    if (!box || !answer || !about) return;
    const width = box.clientWidth, height = box.clientHeight;
    const ctx = sized(box, width, height);
    ctx.clearRect(0, 0, width, height);
    const { scale, ox, oy } = lens();
    const many = answer.points.length;
    const r = Math.min(6, Math.max(1.2, 60 / Math.sqrt(many))) * Math.min(2, Math.sqrt(view.current.zoom));
    const groups: number[][] = about.looks.map(() => []);
    for (let i = 0; i < many; i++) {
      const x = ox + answer.points[i]![0] * scale, y = oy - answer.points[i]![1] * scale;
      if (x > -9 && y > -9 && x < width + 9 && y < height + 9) groups[about.of[i]!]!.push(i);
    }
    about.looks.forEach((look, k) => {
      ctx.fillStyle = look.colour;
      if (r < 2) { // too small for shapes
        for (const i of groups[k]!) ctx.fillRect(ox + answer.points[i]![0] * scale - r, oy - answer.points[i]![1] * scale - r, 2 * r, 2 * r);
        return;
      }
      for (let part = 0; part < groups[k]!.length; part += 2000) {
        ctx.beginPath();
        for (const i of groups[k]!.slice(part, part + 2000)) dot(ctx, look.shape, ox + answer.points[i]![0] * scale, oy - answer.points[i]![1] * scale, r);
        ctx.fill();
      }
    });
    if (chosen.size) {
      ctx.strokeStyle = colours.ink;
      ctx.lineWidth = 1.6;
      ctx.beginPath();
      for (let i = 0; i < many; i++) if (chosen.has(answer.clips[i]!)) dot(ctx, "circle", ox + answer.points[i]![0] * scale, oy - answer.points[i]![1] * scale, r + 2.5);
      ctx.stroke();
    }
    if (names) {
      ctx.font = "600 12px system-ui, 'DejaVu Sans', sans-serif";
      ctx.textAlign = "center";
      ctx.textBaseline = "middle";
      const taken: [number, number, number][] = [];
      for (const cluster of answer.clusters) {
        const x = ox + cluster.x * scale, y = oy - cluster.y * scale, w = ctx.measureText(cluster.text).width + 8;
        if (x < 0 || y < 0 || x > width || y > height) continue;
        const spot = [0, -18, 18, -36, 36].map((by) => y + by).find((v) => !taken.some(([tx, ty, tw]) => Math.abs(tx - x) < (tw + w) / 2 && Math.abs(ty - v) < 18));
        if (spot === undefined) continue;
        taken.push([x, spot, w]);
        ctx.fillStyle = colours.paper;
        ctx.globalAlpha = 0.82;
        ctx.beginPath();
        ctx.roundRect(x - w / 2, spot - 9, w, 18, 4);
        ctx.fill();
        ctx.globalAlpha = 1;
        ctx.fillStyle = colours.ink;
        ctx.fillText(cluster.text, x, spot);
      }
    }
    if (lasso.current && lasso.current.length > 1) {
      ctx.beginPath();
      lasso.current.forEach(([x, y], i) => ctx[i ? "lineTo" : "moveTo"](x, y));
      ctx.closePath();
      ctx.fillStyle = `${colours.accent}33`;
      ctx.strokeStyle = colours.accent;
      ctx.lineWidth = 2;
      ctx.fill();
      ctx.stroke();
    }
  };
  useEffect(redraw); // whatever changed

  const nearest = (x: number, y: number): number => {
    if (!answer) return -1;
    const { scale, ox, oy } = lens();
    let best = -1, least = 12 * 12;
    for (let i = 0; i < answer.points.length; i++) {
      const far = (ox + answer.points[i]![0] * scale - x) ** 2 + (oy - answer.points[i]![1] * scale - y) ** 2;
      if (far < least) { least = far; best = i; }
    }
    return best;
  };
  const zoom = (by: number, x?: number, y?: number): void => {
    const box = canvas.current!;
    const [px, py] = [x ?? box.clientWidth / 2, y ?? box.clientHeight / 2];
    const before = lens();
    const [wx, wy] = [(px - before.ox) / before.scale, (before.oy - py) / before.scale];
    view.current.zoom = Math.min(60, Math.max(0.5, view.current.zoom * by));
    const after = lens();
    view.current.x += wx - (px - after.ox) / after.scale;
    view.current.y += wy - (after.oy - py) / after.scale;
    redraw();
  };
  useEffect(() => {
    const box = canvas.current!;
    const wheel = (event: WheelEvent): void => {
      event.preventDefault();
      const bounds = box.getBoundingClientRect();
      zoom(Math.exp(-event.deltaY * 0.0015), event.clientX - bounds.left, event.clientY - bounds.top);
    };
    box.addEventListener("wheel", wheel, { passive: false });
    const watch = new ResizeObserver(redraw);
    watch.observe(box);
    return () => { box.removeEventListener("wheel", wheel); watch.disconnect(); };
  }, []); // eslint-disable-line
  const shift = (x: number, y: number): void => {
    const { scale } = lens();
    view.current.x += x / scale;
    view.current.y += y / scale;
    redraw();
  };
  const home = (): void => { view.current = { x: 0, y: 0, zoom: 1 }; redraw(); };
  const pickAll = (): void => { if (answer) select(answer.clips); };
  useKeys([
    { keys: "ArrowLeft / ArrowRight / ArrowUp / ArrowDown", does: "Move the map", act: (e) => shift(e.key === "ArrowLeft" ? -60 : e.key === "ArrowRight" ? 60 : 0, e.key === "ArrowUp" ? 60 : e.key === "ArrowDown" ? -60 : 0) },
    { keys: "+ / - / =", does: "Nearer or farther", act: (e) => zoom(e.key === "-" ? 1 / 1.3 : 1.3) },
    { keys: "h", does: "The whole map", act: home },
    { keys: "p", does: "The mouse moves the map, or selects", act: () => setPan(!pan) },
    { keys: "n", does: "Names of clusters", act: () => setNames(!names) },
    { keys: "v", does: "Select what the view shows", act: () => {
      if (!answer) return;
      const { scale, ox, oy } = lens();
      const { clientWidth: w, clientHeight: h } = canvas.current!;
      select(answer.clips.filter((_, i) => { const x = ox + answer.points[i]![0] * scale, y = oy - answer.points[i]![1] * scale; return x >= 0 && y >= 0 && x <= w && y <= h; }));
    } },
    { keys: "Ctrl+a", does: "Select all", act: pickAll },
    { keys: "Escape", does: "Select nothing", act: () => select([]) },
  ]);

  const start = useRef<[number, number] | null>(null);
  const place = (event: React.PointerEvent): [number, number] => {
    const bounds = canvas.current!.getBoundingClientRect();
    return [event.clientX - bounds.left, event.clientY - bounds.top];
  };
  return (
    <main className="map-page">
      <div className="toolbar">
        <NativeSelect size="xs" aria-label="Colour by" value={column} data={COLUMNS.map(([value, label]) => ({ value, label: `Colour: ${label}` }))}
          onChange={(e) => change({ colour: e.currentTarget.value === "label" ? null : e.currentTarget.value }, true)} />
        <Button size="xs" variant={pan ? "default" : "light"} aria-pressed={!pan} onClick={() => setPan(false)}>Lasso</Button>
        <Button size="xs" variant={pan ? "light" : "default"} aria-pressed={pan} onClick={() => setPan(true)}>Move</Button>
        <Button size="xs" variant="default" onClick={home}>Whole map</Button>
        <Checkbox size="xs" label="Names of clusters" checked={names} onChange={() => setNames(!names)} />
        <output className="total">{answer ? `${counted(answer.points.length)} clips; draw round some to select them, Shift adds` : ""}</output>
      </div>
      <div className="map-box">
        <canvas ref={canvas} className={pan ? "pan" : ""} role="img" aria-label={answer ? `Map of ${answer.points.length} clips; groups: ${answer.clusters.map((c) => c.text).join(", ")}` : "Map"}
          onPointerDown={(event) => {
            event.currentTarget.setPointerCapture(event.pointerId);
            start.current = place(event);
            setTip(null);
            if (!pan && event.button === 0) lasso.current = [place(event)];
          }}
          onPointerMove={(event) => {
            const [x, y] = place(event);
            if (start.current) {
              if (lasso.current) { lasso.current.push([x, y]); redraw(); }
              else { shift(start.current[0] - x, y - start.current[1]); start.current = [x, y]; }
              return;
            }
            const i = nearest(x, y);
            setTip(i < 0 ? null : { i, x, y });
          }}
          onPointerUp={(event) => {
            const drawn = lasso.current, from = start.current;
            const [x, y] = place(event);
            lasso.current = null;
            start.current = null;
            redraw();
            if (!answer || !from) return;
            if (!drawn || drawn.length < 4) {
              const i = nearest(x, y);
              if (i >= 0 && Math.hypot(x - from[0], y - from[1]) < 4) go({ view: "clip", clip: answer.clips[i] });
              return;
            }
            const { scale, ox, oy } = lens();
            const found = answer.clips.filter((_, i) => inside(drawn, ox + answer.points[i]![0] * scale, oy - answer.points[i]![1] * scale));
            select(event.shiftKey ? [...chosen, ...found] : found);
          }}
          onPointerLeave={() => setTip(null)} />
        {map.error ? <p className="message" role="alert">{map.error}</p> : !answer && <p className="message" role="status">The map is being made; it appears here by itself.</p>}
        {about && !about.numeric && (
          <div className="legend"><ul>{about.looks.map((look) => (
            <li key={look.name}>
              <svg viewBox="0 0 12 12" fill={look.colour} aria-hidden="true">{look.shape === "circle" ? <circle cx="6" cy="6" r="5" /> : look.shape === "square" ? <rect x="1.5" y="1.5" width="9" height="9" /> : <path d="M6 1 11 11H1z" />}</svg>
              {look.name} <small>{counted(look.clips)}</small>
            </li>
          ))}</ul></div>
        )}
        {about?.numeric && (
          <div className="legend"><ul>{about.looks.filter((_, i) => i % 3 === 0 || i === 11).map((look, i, all) => (
            <li key={i}><svg viewBox="0 0 12 12" fill={look.colour} aria-hidden="true"><circle cx="6" cy="6" r="5" /></svg>{(about.numeric![0] + (i / (all.length - 1)) * (about.numeric![1] - about.numeric![0])).toFixed(1)}</li>
          ))}</ul></div>
        )}
        {tip && answer && (
          <div className="map-tip" style={{ left: Math.min(tip.x + 14, (canvas.current?.clientWidth ?? 900) - 214), top: Math.max(4, Math.min(tip.y + 14, (canvas.current?.clientHeight ?? 600) - 190)) }}>
            <Thumb clip={answer.clips[tip.i]!} width={180} height={110} colours={colours} playing />
            <b>{String(answer.values[tip.i] ?? "none")}</b><br />{answer.clips[tip.i]}
          </div>
        )}
      </div>
      <SelectionBar />
    </main>
  );
}
