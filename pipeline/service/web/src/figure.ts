/** Stick figures of a few lines, of clips in the grid and in lists; and canvases of the size that they are shown. */
import type { Colours } from "./colours";
import type { Motion } from "./stream";

const TURN = -0.6, TILT = 0.18;
const CT = Math.cos(TURN), ST = Math.sin(TURN), CP = Math.cos(TILT), SP = Math.sin(TILT);

interface Fit { scale: number; low: number; high: number; floor: number; middle: [number, number] }
const fits = new WeakMap<Motion, Fit>();

/** How large a loop is, seen from the side, its body held in the middle. */
function fitted(motion: Motion): Fit {
  const known = fits.get(motion);
  if (known) return known;
  let low = Infinity, high = -Infinity, floor = Infinity, wide = 0;
  const step = 3 * motion.joints;
  for (let f = 0; f < motion.frames; f++) {
    const x0 = motion.points[f * step]!, z0 = motion.points[f * step + 2]!;
    for (let i = f * step; i < (f + 1) * step; i += 3) {
      const x = motion.points[i]! - x0, y = motion.points[i + 1]!, z = motion.points[i + 2]! - z0;
      const up = y * CP - (x * ST + z * CT) * SP;
      low = Math.min(low, up); high = Math.max(high, up); floor = Math.min(floor, y);
      wide = Math.max(wide, Math.abs(x * CT - z * ST));
    }
  }
  const fit: Fit = { scale: 1 / Math.max(0.4, (high - low) * 1.16, wide * 1.7), low, high, floor, middle: [0, 0] };
  fits.set(motion, fit);
  return fit;
}

export interface Bones { parents: readonly number[]; sides: readonly ("left" | "right" | "body")[]; head: number }

export function bonesOf(names: readonly string[], parents: readonly number[]): Bones {
  const sides = names.map((name) => (name.startsWith("left") ? "left" : name.startsWith("right") ? "right" : "body"));
  return { parents, sides: sides as Bones["sides"], head: names.indexOf("head") };
}

export const SIDES = ["right", "body", "left"] as const;

/** One frame as the parts of a drawing: the steps of a path of each side, the ground below the hips, the head. */
export interface Figure {
  limbs: Record<(typeof SIDES)[number], string>;
  thick: number;
  ground: { y: number; rx: number; ry: number };
  head: { x: number; y: number; r: number } | null;
}

const short = (value: number): string => value.toFixed(1);

/** A frame of a motion in a picture of `width` x `height` pixels. */
export function figureOf(motion: Motion, frame: number, bones: Bones, width: number, height: number): Figure {
  const { scale, low, high, floor } = fitted(motion);
  const size = scale * Math.min(height, width * 1.1);
  const from = 3 * motion.joints * Math.min(motion.frames - 1, Math.max(0, frame));
  const x0 = motion.points[from]!, z0 = motion.points[from + 2]!;
  const across: number[] = [], up: number[] = [];
  const middle = (low + high) / 2;
  for (let j = 0; j < motion.joints; j++) {
    const x = motion.points[from + 3 * j]! - x0, y = motion.points[from + 3 * j + 1]!, z = motion.points[from + 3 * j + 2]! - z0;
    across.push(width / 2 + (x * CT - z * ST) * size);
    up.push(height / 2 - (y * CP - (x * ST + z * CT) * SP - middle) * size);
  }
  const limbs = { right: "", body: "", left: "" };
  for (let j = 1; j < motion.joints; j++) {
    const p = bones.parents[j]!;
    if (p >= 0) limbs[bones.sides[j]!] += `M${short(across[p]!)} ${short(up[p]!)}L${short(across[j]!)} ${short(up[j]!)}`;
  }
  const head = bones.head < 0 ? null : { x: across[bones.head]!, y: up[bones.head]!, r: 0.075 * size };
  const ground = { y: height / 2 - (floor * CP - middle) * size, rx: 0.34 * size, ry: 0.07 * size };
  return { limbs, thick: Math.max(1.5, 0.045 * size), ground, head };
}

/** Draw one frame into a canvas context of `width` x `height` pixels, which is cleared first. */
export function drawFigure(
  ctx: CanvasRenderingContext2D, motion: Motion, frame: number, bones: Bones, colours: Colours, width: number, height: number,
): void {
  const { limbs, thick, ground, head } = figureOf(motion, frame, bones, width, height);
  ctx.clearRect(0, 0, width, height);
  ctx.fillStyle = colours.edge;
  ctx.beginPath();
  ctx.ellipse(width / 2, ground.y, ground.rx, ground.ry, 0, 0, 7);
  ctx.fill();
  ctx.lineCap = "round";
  ctx.lineWidth = thick;
  for (const side of SIDES) {
    ctx.strokeStyle = colours[side];
    ctx.stroke(new Path2D(limbs[side]));
  }
  if (!head) return;
  ctx.fillStyle = colours.body;
  ctx.beginPath();
  ctx.arc(head.x, head.y, head.r, 0, 7);
  ctx.fill();
}

/** The context of a canvas of its size on the page, in pixels of the page. */
export function sized(canvas: HTMLCanvasElement, width: number, height: number): CanvasRenderingContext2D {
  const ratio = Math.min(2, window.devicePixelRatio || 1);
  const size = [Math.round(width * ratio), Math.round(height * ratio)] as const;
  if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;
  const ctx = canvas.getContext("2d")!;
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  return ctx;
}
