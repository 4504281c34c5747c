/** A clip as a small stick figure that moves when it is pointed at.
 *
 * What stands still is SVG: each canvas is a layer, and a page of them is put together anew whenever one scrolls by. What
 * moves is drawn on a canvas, for the same reason: nothing else of the page is.
 */
import { useEffect, useLayoutEffect, useRef } from "react";
import type { Colours } from "./colours";
import { bonesOf, drawFigure, figureOf, SIDES, sized, type Bones } from "./figure";
import { skeleton } from "./store";
import type { Motion } from "./stream";
import { thumbnail, want } from "./thumbs";

let bones: Bones | null = null;
export function theBones(): Bones {
  const about = skeleton.get()!;
  return (bones ??= bonesOf(about.joints, about.parents));
}

export interface ThumbProps {
  clip: string; width: number; height: number; colours: Colours; playing: boolean;
  /** Motion of its own (a range, a file) in the place of the clip's loop. */
  motion?: Motion | null;
}

/** Put a frame into the elements of a picture, or nothing. `data-frame` says which is shown. */
function show(svg: SVGSVGElement, motion: Motion | null | undefined, frame: number, width: number, height: number): void {
  if (!motion) {
    svg.removeAttribute("data-frame");
    return;
  }
  const { limbs, thick, ground, head } = figureOf(motion, frame, theBones(), width, height);
  const [floor, ...rest] = svg.children;
  const set = (element: Element, values: Record<string, string | number>): void => {
    for (const name in values) element.setAttribute(name, String(values[name]));
  };
  set(floor!, { cy: ground.y.toFixed(1), rx: ground.rx.toFixed(1), ry: ground.ry.toFixed(1) });
  SIDES.forEach((side, i) => set(rest[i]!, { d: limbs[side], "stroke-width": thick.toFixed(1) }));
  set(rest[SIDES.length]!, head ? { cx: head.x.toFixed(1), cy: head.y.toFixed(1), r: head.r.toFixed(1) } : { r: 0 });
  svg.setAttribute("data-frame", String(frame));
}

export function Thumb(props: ThumbProps): React.JSX.Element {
  return props.playing ? <Moving {...props} /> : <Still {...props} />;
}

function Still({ clip, width, height, colours, motion }: ThumbProps): React.JSX.Element {
  const picture = useRef<SVGSVGElement>(null);
  useLayoutEffect(() => {
    const draw = (): void => {
      const found = motion === undefined ? thumbnail(clip) : motion;
      if (picture.current) show(picture.current, found, Math.floor((found?.frames ?? 0) / 3), width, height);
    };
    draw();
    return motion === undefined ? want(clip, draw) : undefined;
  }, [clip, width, height, motion]);
  return (
    <svg ref={picture} className="thumb" width={width} height={height} viewBox={`0 0 ${width} ${height}`} aria-hidden="true">
      <ellipse cx={width / 2} fill={colours.edge} />
      {SIDES.map((side) => <path key={side} fill="none" stroke={colours[side]} strokeLinecap="round" />)}
      <circle fill={colours.body} />
    </svg>
  );
}

function Moving({ clip, width, height, colours, motion }: ThumbProps): React.JSX.Element {
  const canvas = useRef<HTMLCanvasElement>(null);
  useLayoutEffect(() => {
    const begun = performance.now();
    const draw = (now: number): void => {
      const found = motion === undefined ? thumbnail(clip) : motion;
      if (!found || !canvas.current) return;
      const frame = Math.floor((Math.max(0, now - begun) / 1000) * found.fps) % found.frames;
      drawFigure(sized(canvas.current, width, height), found, frame, theBones(), colours, width, height);
    };
    draw(begun);
    let asked = requestAnimationFrame(function tick(now) {
      draw(now);
      asked = requestAnimationFrame(tick);
    });
    return () => cancelAnimationFrame(asked);
  }, [clip, width, height, colours, motion]);
  useEffect(() => (motion === undefined ? want(clip, () => undefined) : undefined), [clip, motion]);
  return <canvas ref={canvas} className="thumb" style={{ width, height }} aria-hidden="true" />;
}
