/** The moment that a page shows, which players, timelines and curves share. */
import { Store } from "./store";

export const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4] as const;

export class Clock {
  /** Seconds of the first clip. */
  now = 0;
  length = 1;
  /** Frames a second of the first clip, for steps. */
  fps = 30;
  loop = true;
  /** What is played again and again: the whole, or a range. */
  from = 0;
  to = Infinity;
  readonly playing = new Store(false);
  readonly speed = new Store(1);
  private listeners = new Set<() => void>();
  private asked = 0;
  private last = 0;

  subscribe = (listener: () => void): (() => void) => {
    this.listeners.add(listener);
    return () => this.listeners.delete(listener);
  };

  /** Draw again, once before the next picture. */
  redraw = (): void => {
    if (!this.asked) this.asked = requestAnimationFrame(this.tick);
  };

  seek(seconds: number): void {
    this.now = Math.min(this.length, Math.max(0, seconds));
    this.redraw();
  }

  step(frames: number): void {
    this.playing.set(false);
    this.seek((this.frame + frames) / this.fps);
  }

  get frame(): number {
    return Math.floor(this.now * this.fps + 1e-6);
  }

  play(on: boolean): void {
    if (on && this.now >= Math.min(this.to, this.length) - 1e-3) this.now = this.from;
    this.last = 0;
    this.playing.set(on);
    this.redraw();
  }

  stop(): void {
    cancelAnimationFrame(this.asked);
    this.asked = 0;
    this.playing.set(false);
  }

  private tick = (time: number): void => {
    this.asked = 0;
    if (this.playing.get()) {
      if (this.last) this.now += Math.min(0.25, (time - this.last) / 1000) * this.speed.get();
      this.last = time;
      const end = Math.min(this.to, this.length);
      if (this.now >= end) {
        if (this.loop) this.now = this.from + ((this.now - this.from) % Math.max(0.05, end - this.from));
        else { this.now = end; this.playing.set(false); }
      }
      if (this.playing.get()) this.asked = requestAnimationFrame(this.tick);
    }
    for (const listener of this.listeners) listener();
  };
}
