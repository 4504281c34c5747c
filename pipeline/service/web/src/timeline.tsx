/** What is known of every moment of a clip, as bands; a range is marked by dragging, edges of segments are moved. */
import { useEffect, useMemo, useRef, useState } from "react";
import type { Band, Span, Timeline as Answer } from "./api";
import type { Clock } from "./clock";
import { colourOf, inkOn, type Colours } from "./colours";
import { sized } from "./figure";

const BAND = 18, RULER = 24;
const ORDER = ["segments", "annotations", "quality", "contacts", "motifs", "symbols"];
const TITLES: Record<string, string> = { segments: "Segments", annotations: "Decided", quality: "Faults", contacts: "Feet", motifs: "Motifs", symbols: "Symbols" };

export function ordered(bands: readonly Band[]): Band[] {
  return [...bands].sort((a, b) => ORDER.indexOf(a.name) - ORDER.indexOf(b.name));
}

/** Spans that overlap are drawn in lanes of their own. */
function lanes(band: Band): { span: Span; lane: number }[] {
  const spans = band.spans;
  if (band.name === "contacts") return spans.map((span) => ({ span, lane: String(span.value).startsWith("right") ? 1 : 0 }));
  const ends: number[] = [];
  return [...spans].sort((a, b) => a.start - b.start || a.stop - b.stop).map((span) => {
    let lane = ends.findIndex((end) => end <= span.start);
    if (lane < 0) lane = ends.length < 3 ? ends.push(0) - 1 : 2;
    ends[lane] = Math.max(ends[lane]!, span.stop);
    return { span, lane };
  });
}

/** What the bands say of a frame. */
export function saidAt(bands: readonly Band[], frame: number): string {
  const texts = ordered(bands).flatMap((band) => band.spans.filter((s) => s.start <= frame && frame < s.stop).map((s) => s.text || String(s.value ?? "")));
  return [...new Set(texts)].join(" · ");
}

export interface Range { from: number; to: number }

function Lane({ band, frames, colours, clock, fps }: { band: Band; frames: number; colours: Colours; clock: Clock; fps: number }): React.JSX.Element {
  const canvas = useRef<HTMLCanvasElement>(null);
  const placed = useMemo(() => lanes(band), [band]);
  const count = Math.max(1, ...placed.map((one) => one.lane + 1));
  const height = count * BAND;
  const short = ["motifs", "symbols", "contacts"].includes(band.name); // the title says what the numbers are
  useEffect(() => {
    const element = canvas.current!;
    const draw = (): void => {
      const width = element.clientWidth;
      const ctx = sized(element, width, height);
      ctx.clearRect(0, 0, width, height);
      ctx.font = "11px system-ui, 'DejaVu Sans', sans-serif";
      ctx.textBaseline = "middle";
      for (const { span, lane } of placed) {
        const x = (span.start / frames) * width, w = Math.max(1.5, ((span.stop - span.start) / frames) * width);
        const fill = colourOf(span.colour_index);
        ctx.fillStyle = fill;
        ctx.fillRect(x, lane * BAND, w - (w > 4 ? 1 : 0), BAND - 1);
        const text = String(short ? span.value ?? "" : span.text || (span.value ?? ""));
        if (w > (short ? 14 : 26)) {
          ctx.save();
          ctx.beginPath();
          ctx.rect(x, lane * BAND, w - 3, BAND);
          ctx.clip();
          ctx.fillStyle = inkOn(fill);
          ctx.fillText(text, x + 4, lane * BAND + BAND / 2);
          ctx.restore();
        }
      }
    };
    const watch = new ResizeObserver(draw);
    watch.observe(element);
    return () => watch.disconnect();
  }, [placed, frames, colours, height, short]);
  const at = (event: React.MouseEvent): Span | undefined => {
    const box = canvas.current!.getBoundingClientRect();
    const frame = ((event.clientX - box.left) / box.width) * frames, lane = Math.floor((event.clientY - box.top) / BAND);
    return placed.find((one) => one.lane === lane && one.span.start <= frame && frame < one.span.stop)?.span;
  };
  return (
    <canvas ref={canvas} className="lane" style={{ height }} role="img"
      aria-label={`${TITLES[band.name] ?? band.name}: ${band.spans.slice(0, 30).map((s) => s.text || s.value).join(", ")}`}
      onMouseMove={(event) => {
        const span = at(event);
        event.currentTarget.title = span ? `${span.text || span.value}: ${(span.start / fps).toFixed(2)} to ${(span.stop / fps).toFixed(2)} s` : "";
      }}
      onClick={(event) => { const span = at(event); if (span) clock.seek(span.start / fps); }} />
  );
}

interface TimelineProps {
  timeline: Answer | null; frames: number; fps: number; clock: Clock; colours: Colours; range: Range | null;
  onRange: (range: Range | null, done: boolean) => void;
  /** Segments whose edges can be moved; null: they are not being corrected. */
  editing: Span[] | null;
  onEdges: (segments: Span[], changed: number[], done: boolean) => void;
}

export function Timeline({ timeline, frames, fps, clock, colours, range, onRange, editing, onEdges }: TimelineProps): React.JSX.Element {
  const ruler = useRef<HTMLDivElement>(null);
  const needle = useRef<HTMLDivElement>(null);
  const [dragged, setDragged] = useState<{ anchor: number } | null>(null);
  useEffect(() => {
    const draw = (): void => {
      if (needle.current) needle.current.style.left = `${(100 * Math.min(frames, clock.now * fps)) / Math.max(1, frames)}%`;
    };
    draw();
    return clock.subscribe(draw);
  }, [clock, frames, fps]);

  const frameAt = (x: number): number => {
    const box = ruler.current!.getBoundingClientRect();
    return Math.min(frames, Math.max(0, Math.round(((x - box.left) / box.width) * frames)));
  };
  const step = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300].find((s) => frames / fps / s <= 16) ?? 600;
  const ticks = Array.from({ length: Math.floor(frames / fps / step) + 1 }, (_, i) => i * step);
  const bands = useMemo(() => {
    const found = ordered(timeline?.bands ?? []);
    if (!editing) return found;
    return [{ name: "segments", spans: editing }, ...found.filter((band) => band.name !== "segments")];
  }, [timeline, editing]);

  // Which segments end where the next one starts, as they came: such an edge is moved in both.
  const count = editing?.length ?? 0;
  const joined = useMemo(() => (editing ?? []).map((span, i) => editing![i + 1]?.start === span.stop), [count, timeline]); // eslint-disable-line
  const laneOf = useMemo(() => new Map(editing ? lanes({ name: "segments", spans: editing }).map((one) => [one.span, one.lane]) : []), [editing]);
  const move = (i: number, side: "start" | "stop", frame: number, done: boolean): void => {
    const segments = editing!.map((span) => ({ ...span }));
    const span = segments[i]!;
    const before = side === "start" && joined[i - 1] ? segments[i - 1] : undefined; // it ends where this one starts
    if (side === "start") {
      span.start = Math.max(before ? before.start + 1 : 0, Math.min(span.stop - 1, frame));
      if (before) before.stop = span.start;
    } else span.stop = Math.min(frames, Math.max(span.start + 1, frame));
    onEdges(segments, before ? [i, i - 1] : [i], done);
  };

  return (
    <div className="timeline">
      <div className="band-titles" aria-hidden="true">
        <span style={{ height: RULER }}>Mark</span>
        {bands.map((band) => <span key={band.name} style={{ height: Math.max(1, ...lanes(band).map((o) => o.lane + 1)) * BAND + 3 }}>{TITLES[band.name] ?? band.name}</span>)}
      </div>
      <div className="bands">
        <div ref={ruler} className="ruler" style={{ height: RULER }} title="Drag to mark a range; [ and ] mark its ends at the moment shown"
          onPointerDown={(event) => {
            event.currentTarget.setPointerCapture(event.pointerId);
            const anchor = frameAt(event.clientX);
            setDragged({ anchor });
            clock.seek(anchor / fps);
          }}
          onPointerMove={(event) => {
            if (!dragged) return;
            const here = frameAt(event.clientX);
            clock.seek(here / fps);
            if (Math.abs(here - dragged.anchor) > 1) onRange({ from: Math.min(here, dragged.anchor), to: Math.max(here, dragged.anchor) }, false);
          }}
          onPointerUp={(event) => {
            if (!dragged) return;
            const here = frameAt(event.clientX);
            setDragged(null);
            if (Math.abs(here - dragged.anchor) > 1) onRange({ from: Math.min(here, dragged.anchor), to: Math.max(here, dragged.anchor) }, true);
          }}>
          {ticks.map((s) => <span key={s} className="tick" style={{ left: `${(100 * s * fps) / frames}%` }}>{step < 1 ? s.toFixed(1) : s} s</span>)}
        </div>
        {bands.map((band) => (
          <div key={band.name} className="lane-box">
            <Lane band={band} frames={frames} colours={colours} clock={clock} fps={fps} />
            {editing && band.name === "segments" && editing.flatMap((span, i) => (["start", "stop"] as const).map((side) => {
              if (side === "stop" && joined[i]) return null;
              return (
                <button type="button" key={`${i}${side}`} className="edge" style={{ left: `${(100 * span[side]) / frames}%`, top: BAND * (laneOf.get(span) ?? 0) - 2, height: BAND + 3 }}
                  aria-label={`${side === "start" ? "Start" : "End"} of ${span.text || span.value}: frame ${span[side]}`} title="Drag, or use the arrow keys"
                  onPointerDown={(event) => { event.currentTarget.setPointerCapture(event.pointerId); event.stopPropagation(); }}
                  onPointerMove={(event) => { if (event.currentTarget.hasPointerCapture(event.pointerId)) { const f = frameAt(event.clientX); clock.seek(f / fps); move(i, side, f, false); } }}
                  onPointerUp={(event) => { if (event.currentTarget.hasPointerCapture(event.pointerId)) move(i, side, frameAt(event.clientX), true); }}
                  onKeyDown={(event) => {
                    const by = event.key === "ArrowLeft" ? -1 : event.key === "ArrowRight" ? 1 : 0;
                    if (!by) return;
                    event.preventDefault();
                    event.stopPropagation();
                    const to = span[side] + by * (event.shiftKey ? Math.round(fps / 2) : 1);
                    clock.seek(to / fps);
                    move(i, side, to, true);
                  }} />
              );
            }))}
          </div>
        ))}
        {range && <div className="range" style={{ left: `${(100 * range.from) / frames}%`, width: `${(100 * (range.to - range.from)) / frames}%` }} />}
        <div ref={needle} className="needle" />
      </div>
    </div>
  );
}
