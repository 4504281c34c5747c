/** A clip as a small stick figure that moves when it is pointed at. */
import { useEffect, useRef } from "react";
import type { Colours } from "./colours";
import { bonesOf, drawFigure, sized, type Bones } from "./figure";
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

export function Thumb({ clip, width, height, colours, playing, motion }: ThumbProps): React.JSX.Element {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const draw = (frame: number): boolean => {
      const found = motion === undefined ? thumbnail(clip) : motion;
      const ctx = canvas.current && sized(canvas.current, width, height);
      if (!ctx) return false;
      if (!found) { ctx.clearRect(0, 0, width, height); return false; }
      drawFigure(ctx, found, frame, theBones(), colours, width, height);
      return true;
    };
    const still = (): number => {
      const found = motion === undefined ? thumbnail(clip) : motion;
      return found ? Math.floor(found.frames / 3) : 0;
    };
    draw(still());
    const release = motion === undefined ? want(clip, () => draw(still())) : undefined;
    let asked = 0;
    if (playing) {
      const begun = performance.now();
      const tick = (now: number): void => {
        const found = motion === undefined ? thumbnail(clip) : motion;
        if (found) draw(Math.floor((Math.max(0, now - begun) / 1000) * found.fps) % found.frames);
        asked = requestAnimationFrame(tick);
      };
      asked = requestAnimationFrame(tick);
    }
    return () => { release?.(); cancelAnimationFrame(asked); };
  }, [clip, width, height, colours, playing, motion]);
  return <canvas ref={canvas} className="thumb" style={{ width, height }} aria-hidden="true" />;
}
