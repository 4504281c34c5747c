/** Up to four clips side by side on one canvas; the mouse, fingers and arrow keys turn the view. */
import { useEffect, useRef } from "react";
import type { Clock } from "./clock";
import type { Colours } from "./colours";
import { Stage, type Shows } from "./scene";
import { skeleton } from "./store";
import type { Motion } from "./stream";

export interface Pane { key: string; motion: Motion | null; /** Seconds of this clip at a moment of the clock. */ time: (now: number) => number }

interface PlayersProps {
  panes: readonly Pane[]; clock: Clock; shows: Shows; follow: boolean; colours: Colours; stageRef?: React.RefObject<Stage | null>;
  label: string;
}

export function Players({ panes, clock, shows, follow, colours, stageRef, label }: PlayersProps): React.JSX.Element {
  const canvas = useRef<HTMLCanvasElement>(null);
  const own = useRef<Stage | null>(null);
  const latest = useRef({ panes, shows });
  latest.current = { panes, shows };
  const first = useRef(colours);

  useEffect(() => {
    const element = canvas.current!;
    const stage = new Stage(element, skeleton.get()!, first.current);
    own.current = stage;
    if (stageRef) stageRef.current = stage;
    const draw = (): void => stage.draw(latest.current.panes.map((pane) => pane.time(clock.now)), latest.current.shows);
    const release = clock.subscribe(draw);
    const watch = new ResizeObserver(clock.redraw);
    watch.observe(element);
    const fingers = new Map<number, [number, number]>();
    let apart = 0;
    const down = (event: PointerEvent): void => {
      element.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      apart = 0;
    };
    const move = (event: PointerEvent): void => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      if (fingers.size === 1) stage.turn((before[0] - event.clientX) * 0.01, (event.clientY - before[1]) * 0.01);
      else {
        const [a, b] = [...fingers.values()] as [[number, number], [number, number]];
        const now = Math.hypot(a[0] - b[0], a[1] - b[1]);
        if (apart && now) stage.zoom(now / apart);
        apart = now;
      }
      clock.redraw();
    };
    const up = (event: PointerEvent): void => { fingers.delete(event.pointerId); apart = 0; };
    const wheel = (event: WheelEvent): void => {
      event.preventDefault();
      stage.zoom(Math.exp(-Math.min(300, Math.max(-300, event.deltaY)) * 0.0015));
      clock.redraw();
    };
    const home = (): void => { stage.home(); clock.redraw(); };
    element.addEventListener("pointerdown", down);
    element.addEventListener("pointermove", move);
    element.addEventListener("pointerup", up);
    element.addEventListener("pointercancel", up);
    element.addEventListener("wheel", wheel, { passive: false });
    element.addEventListener("dblclick", home);
    return () => {
      release();
      watch.disconnect();
      stage.dispose();
      own.current = null;
    };
  }, [clock, stageRef]);

  useEffect(() => {
    own.current?.paint(colours);
    clock.redraw();
  }, [colours, clock]);
  useEffect(() => {
    if (!own.current) return;
    own.current.view.follow = follow;
    own.current.show(panes.map((pane) => pane.motion), panes.map((pane) => pane.key));
    clock.redraw();
  }, [panes, shows, follow, clock]);

  const turn = (event: React.KeyboardEvent): void => {
    const by = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[event.key];
    if (!by || event.shiftKey) return;
    event.preventDefault();
    event.stopPropagation();
    own.current?.turn(by[0]!, by[1]!);
    clock.redraw();
  };
  return <canvas ref={canvas} className="stage" tabIndex={0} role="img" aria-label={label} onKeyDown={turn} />;
}
