/** How high a joint is and how fast it moves, over time. */
import { useEffect, useMemo, useRef } from "react";
import type { Clock } from "./clock";
import { PALETTE, type Colours } from "./colours";
import { sized } from "./figure";
import type { Motion } from "./stream";

export function curveOf(motion: Motion, joint: number, measure: "height" | "speed"): Float32Array {
  const { points, joints, frames, fps } = motion;
  const found = new Float32Array(frames);
  for (let f = 0; f < frames; f++) {
    const i = 3 * (f * joints + joint);
    if (measure === "height") { found[f] = points[i + 1]!; continue; }
    const a = 3 * (Math.max(0, f - 1) * joints + joint), b = 3 * (Math.min(frames - 1, f + 1) * joints + joint);
    const steps = Math.min(frames - 1, f + 1) - Math.max(0, f - 1);
    found[f] = steps ? (Math.hypot(points[b]! - points[a]!, points[b + 1]! - points[a + 1]!, points[b + 2]! - points[a + 2]!) * fps) / steps : 0;
  }
  return found;
}

interface CurveProps { motions: readonly (Motion | null)[]; times: readonly ((now: number) => number)[]; joint: number; measure: "height" | "speed"; clock: Clock; colours: Colours; length: number }

export function Curve({ motions, times, joint, measure, clock, colours, length }: CurveProps): React.JSX.Element {
  const canvas = useRef<HTMLCanvasElement>(null);
  const curves = useMemo(() => motions.map((motion) => motion && curveOf(motion, joint, measure)), [motions, joint, measure]);
  const [low, high] = useMemo(() => {
    const values = curves.flatMap((curve) => (curve ? within(curve) : []));
    const least = measure === "speed" || !values.length ? 0 : Math.min(...values), most = Math.max(least + 0.1, ...values);
    return [least, most];
  }, [curves, measure]);
  useEffect(() => {
    const element = canvas.current!;
    const draw = (): void => {
      const width = element.clientWidth, height = element.clientHeight;
      if (!width) return;
      const ctx = sized(element, width, height);
      ctx.clearRect(0, 0, width, height);
      const up = (v: number): number => height - 4 - ((v - low) / (high - low)) * (height - 8);
      ctx.strokeStyle = colours.edge;
      ctx.lineWidth = 1;
      ctx.beginPath();
      for (const v of [low, high]) { ctx.moveTo(0, up(v)); ctx.lineTo(width, up(v)); }
      ctx.stroke();
      curves.forEach((curve, k) => {
        const motion = motions[k];
        if (!curve || !motion) return;
        ctx.strokeStyle = k === 0 ? colours.ink : PALETTE[k]!;
        ctx.lineWidth = k === 0 ? 1.6 : 1.4;
        ctx.setLineDash(k === 0 ? [] : [[6, 3], [2, 3], [8, 3, 2, 3]][(k - 1) % 3]!);
        ctx.beginPath();
        for (let x = 0; x <= width; x++) {
          const f = Math.floor(times[k]!((x / width) * length) * motion.fps);
          if (f < 0 || f >= curve.length) continue;
          ctx[x ? "lineTo" : "moveTo"](x, up(curve[f]!));
        }
        ctx.stroke();
      });
      ctx.setLineDash([]);
      const x = (clock.now / length) * width;
      ctx.strokeStyle = colours.accent;
      ctx.lineWidth = 1.5;
      ctx.beginPath();
      ctx.moveTo(x, 0);
      ctx.lineTo(x, height);
      ctx.stroke();
    };
    draw();
    const watch = new ResizeObserver(draw);
    watch.observe(element);
    const release = clock.subscribe(draw);
    return () => { release(); watch.disconnect(); };
  }, [curves, low, high, motions, times, clock, colours, length]);
  const seek = (event: React.PointerEvent): void => {
    if (!event.buttons) return;
    const box = event.currentTarget.getBoundingClientRect();
    clock.seek(((event.clientX - box.left) / box.width) * length);
  };
  const unit = measure === "speed" ? "m/s" : "m", title = measure === "speed" ? "Speed" : "Height";
  return (
    <>
      <div className="curve-scale" aria-hidden="true"><span>{high.toFixed(2)} {unit}</span><b>{title}</b><span>{low.toFixed(2)} {unit}</span></div>
      <canvas ref={canvas} className="curve" role="img" aria-label={`${title} of the joint over time, from ${low.toFixed(2)} to ${high.toFixed(2)} ${unit}`} onPointerDown={seek} onPointerMove={seek} />
    </>
  );
}

/** From where to where nearly all of a curve goes: a jump of one frame would flatten the rest. */
function within(curve: Float32Array): [number, number] {
  const sorted = Float32Array.from(curve).sort();
  const at = (share: number): number => sorted[Math.floor(share * (sorted.length - 1))] ?? 0;
  const margin = 0.05 * (at(0.985) - at(0.015));
  return [at(0.015) - margin, at(0.985) + margin];
}
