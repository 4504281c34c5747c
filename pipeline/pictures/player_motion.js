/* The motions of the page: joints in time, and which of a foot stand. */
const page = JSON.parse(document.getElementById("motion").textContent);
const at = (id) => document.getElementById(id);
const within = (value, low, high) => Math.min(high, Math.max(low, value));
const BAND = 20;

/* Packed millimetres to metres; the body stands on the ground, begins at the origin and faces +z. */
function unpacked(clip) {
  const view = new DataView(Uint8Array.from(atob(clip.motion), (c) => c.charCodeAt(0)).buffer);
  const joints = page.parents.length, count = clip.count;
  const points = new Float32Array(count * joints * 3);
  const cos = Math.cos(clip.heading), sin = Math.sin(clip.heading);
  const x0 = view.getInt32(0, true), z0 = view.getInt32(8, true);
  for (let f = 0; f < count; f++) {
    const root = [0, 4, 8].map((b) => view.getInt32(12 * f + b, true));
    for (let j = 0; j < joints; j++) {
      const from = 12 * count + 6 * ((joints - 1) * f + j - 1);
      const off = j ? [0, 2, 4].map((b) => view.getInt16(from + b, true)) : [0, 0, 0];
      const x = (root[0] + off[0] - x0) / 1000, z = (root[2] + off[2] - z0) / 1000;
      const to = 3 * (joints * f + j);
      points[to] = x * cos - z * sin;
      points[to + 1] = (root[1] + off[1]) / 1000 - clip.floor;
      points[to + 2] = x * sin + z * cos;
    }
  }
  return points;
}

class Pane {
  constructor(clip, figure) {
    this.clip = clip;
    this.points = unpacked(clip);
    this.canvas = figure.querySelector("canvas");
    this.now = figure.querySelector(".now");
    this.seconds = clip.count / clip.fps;
    const path = Array.from({ length: clip.count }, (_, f) => this.joint(f, 0));
    const low = [0, 2].map((i) => Math.min(...path.map((p) => p[i])));
    const high = [0, 2].map((i) => Math.max(...path.map((p) => p[i])));
    this.middle = [(low[0] + high[0]) / 2, 0, (low[1] + high[1]) / 2];
    this.reach = Math.hypot(high[0] - low[0], high[1] - low[1]) / 2;
  }

  joint(frame, joint) {
    const i = 3 * (page.parents.length * frame + joint);
    return [this.points[i], this.points[i + 1], this.points[i + 2]];
  }

  /* How many seconds of the timeline a second of the clip takes. */
  pace() { return stretched() ? length() / this.seconds : 1; }

  /* Which of the shown frames a moment of the timeline falls on. */
  frame(seconds) {
    return within(Math.floor((seconds / this.pace()) * this.clip.fps + 1e-6), 0, this.clip.count - 1);
  }
}

const BEARING = { speed: 0.45, height: 0.05 }; // a joint of a foot stands that is slower and lower, body lengths (a second)
const BODY_LENGTH = 0.72; // of the height of a body

/* [frames] of each joint of the feet, whether it stands: slow and near where it is lowest. */
function standing(pane) {
  const { count, fps, height } = pane.clip;
  const size = BODY_LENGTH * height;
  return page.feet.map((joint) => {
    const heights = Array.from({ length: count }, (_, f) => pane.joint(f, joint)[1]);
    const low = [...heights].sort((a, b) => a - b)[Math.floor(0.05 * (count - 1))];
    return heights.map((up, f) => {
      const [a, b] = [pane.joint(Math.max(0, f - 1), joint), pane.joint(Math.min(count - 1, f + 1), joint)];
      const frames = Math.min(count - 1, f + 1) - Math.max(0, f - 1);
      const speed = frames ? (Math.hypot(...a.map((v, i) => b[i] - v)) * fps) / frames : 0;
      return speed < BEARING.speed * size && up - low < BEARING.height * size;
    });
  });
}

const panes = page.clips.map((clip, i) => new Pane(clip, document.querySelectorAll("figure")[i]));
const first = panes[0];
const HOME = { turn: -0.7, tilt: 0.2, zoom: 1 };
const camera = { ...HOME, follow: true };
let moment = 0; // shown frames of the timeline, counted at the first clip's rate
let playing = false;

function stretched() { return Boolean(at("stretch") && at("stretch").checked); }
function whole() { return stretched() ? first.clip.seconds : Math.max(...page.clips.map((c) => c.seconds)); }
function length() { return stretched() ? first.seconds : Math.max(...panes.map((p) => p.seconds)); }
function steps() { return Math.max(1, Math.round(length() * first.clip.fps)); }
function frame() { return Math.floor(moment + 1e-6); }
function seconds() { return frame() / first.clip.fps; }

