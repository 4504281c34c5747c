/** The compact binary stream of motion: block `MLM1`. */
export interface Motion {
  joints: number;
  frames: number;
  fps: number;
  /** Places [frames, joints, 3] in metres, y up. */
  points: Float32Array;
  /** Bit 0: the left foot stands; bit 1: the right. */
  contacts: Uint8Array;
}

const HEAD = 32;

export function decoded(buffer: ArrayBuffer, start = 0, length = buffer.byteLength - start): Motion | null {
  if (length < HEAD) return null;
  const view = new DataView(buffer, start, length);
  if (view.getUint32(0, true) !== 0x314d4c4d) throw new Error("This is no stream of motion.");
  const joints = view.getUint32(4, true), frames = view.getUint32(8, true);
  const fps = view.getFloat32(12, true), scale = view.getFloat32(16, true);
  const origin = [view.getFloat32(20, true), view.getFloat32(24, true), view.getFloat32(28, true)];
  const count = frames * joints * 3;
  if (length < HEAD + 2 * count + frames) throw new Error("The stream of motion is cut short.");
  const steps = (start + HEAD) % 2
    ? new Int16Array(buffer.slice(start + HEAD, start + HEAD + 2 * count))
    : new Int16Array(buffer, start + HEAD, count);
  const points = new Float32Array(count);
  for (let i = 0; i < count; i++) points[i] = origin[i % 3]! + scale * steps[i]!;
  return { joints, frames, fps, points, contacts: new Uint8Array(buffer.slice(start + HEAD + 2 * count, start + HEAD + 2 * count + frames)) };
}

/** Blocks in a frame: how many, then the length of each and the block. */
export function unframed(buffer: ArrayBuffer): (Motion | null)[] {
  const view = new DataView(buffer);
  const count = view.getUint32(0, true);
  const found: (Motion | null)[] = [];
  let place = 4;
  for (let i = 0; i < count; i++) {
    const length = view.getUint32(place, true);
    found.push(length ? decoded(buffer, place + 4, length) : null);
    place += 4 + length;
  }
  return found;
}

/** The same motion in a mirror: x turned round, sides exchanged. */
export function mirrored(motion: Motion, names: readonly string[]): Motion {
  const other = names.map((name) => {
    const twin = name.startsWith("left_") ? `right_${name.slice(5)}` : name.startsWith("right_") ? `left_${name.slice(6)}` : name;
    return Math.max(0, names.indexOf(twin));
  });
  const points = new Float32Array(motion.points.length);
  for (let f = 0; f < motion.frames; f++) {
    for (let j = 0; j < motion.joints; j++) {
      const from = 3 * (f * motion.joints + other[j]!), to = 3 * (f * motion.joints + j);
      points[to] = -motion.points[from]!;
      points[to + 1] = motion.points[from + 1]!;
      points[to + 2] = motion.points[from + 2]!;
    }
  }
  const contacts = motion.contacts.map((c) => ((c & 1) << 1) | ((c >> 1) & 1));
  return { ...motion, points, contacts };
}
