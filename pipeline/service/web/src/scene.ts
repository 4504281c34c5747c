/** Bodies in space: one WebGL canvas for up to four clips side by side, all seen by the same camera. */
import {
  AmbientLight, BufferAttribute, BufferGeometry, CircleGeometry, Color, CylinderGeometry, DirectionalLight, DynamicDrawUsage,
  GridHelper, Group, HemisphereLight, InstancedMesh, Line, LineBasicMaterial, Matrix4, Mesh, MeshBasicMaterial, MeshLambertMaterial,
  PerspectiveCamera, Quaternion, Scene, SphereGeometry, Vector3, WebGLRenderer,
} from "three";
import type { Skeleton } from "./api";
import type { Colours } from "./colours";
import type { Motion } from "./stream";

export interface Shows { contacts: boolean; trails: boolean; path: boolean; ground: boolean }
const HOME = { turn: -0.7, tilt: 0.22, zoom: 1 };
const TRAIL = 1.2; // seconds
const UP = new Vector3(0, 1, 0), NOWHERE = new Matrix4().makeScale(0, 0, 0);

/** One body and what is drawn of it. */
class Body {
  readonly scene = new Scene();
  readonly middle = new Vector3();
  reach = 0.5;
  private bones: InstancedMesh;
  private joints: InstancedMesh;
  private shadow = new Group();
  private shadows: InstancedMesh[];
  private discs: Mesh[];
  private trails: { line: Line; joint: number }[];
  private path: Line;
  private grid: GridHelper | null = null;
  private floor = 0;
  private feet: [number[], number[]];
  private flat: MeshBasicMaterial;
  private links: [number, number][];

  constructor(readonly motion: Motion, private about: Skeleton, colours: Colours) {
    const { joints, parents } = about;
    this.links = parents.map((p, j) => [p, j] as [number, number]).filter(([p]) => p >= 0);
    const lit = new MeshLambertMaterial();
    this.bones = new InstancedMesh(new CylinderGeometry(1, 1, 1, 12, 1, true), lit, this.links.length);
    this.joints = new InstancedMesh(new SphereGeometry(1, 14, 10), lit, joints.length);
    this.flat = new MeshBasicMaterial();
    this.shadows = [this.bones, this.joints].map((mesh) => {
      const flat = new InstancedMesh(mesh.geometry, this.flat, mesh.count);
      flat.instanceMatrix = mesh.instanceMatrix;
      return flat;
    });
    for (const mesh of [this.bones, this.joints, ...this.shadows]) {
      mesh.frustumCulled = false;
      mesh.instanceMatrix.setUsage(DynamicDrawUsage);
    }
    this.shadow.add(...this.shadows);
    this.shadow.scale.y = 0.0005;
    const side = (name: string): string => (name.startsWith("left") ? colours.left : name.startsWith("right") ? colours.right : colours.body);
    this.links.forEach(([, j], i) => this.bones.setColorAt(i, new Color(side(joints[j]!))));
    joints.forEach((name, j) => this.joints.setColorAt(j, new Color(side(name))));
    const feet = (which: string): number[] => ["ankle", "toe"].map((part) => joints.indexOf(`${which}_${part}`)).filter((j) => j >= 0);
    this.feet = [feet("left"), feet("right")];
    this.discs = [0, 1].map(() => {
      const disc = new Mesh(new CircleGeometry(0.1, 24), new MeshBasicMaterial({ color: colours.contact, transparent: true, opacity: 0.8, depthWrite: false }));
      disc.rotation.x = -Math.PI / 2;
      disc.renderOrder = 2;
      return disc;
    });
    const most = Math.ceil(TRAIL * motion.fps) + 2;
    this.trails = ["left_wrist", "right_wrist", "left_toe", "right_toe"].map((name) => joints.indexOf(name)).filter((j) => j >= 0)
      .map((joint) => ({ joint, line: this.line(most, side(joints[joint]!), 0.9) }));
    this.path = this.line(Math.min(motion.frames, 2000), colours.faint, 0.8);
    this.measure();
    this.scene.add(new AmbientLight(0xffffff, 0.9), new HemisphereLight(0xffffff, 0x667788, 1.3), this.bones, this.joints, this.shadow, ...this.discs, ...this.trails.map((t) => t.line), this.path);
    const sun = new DirectionalLight(0xffffff, 1.5);
    sun.position.set(1.5, 4, 2.5);
    this.scene.add(sun);
    this.paint(colours);
  }

  private line(points: number, colour: string, opacity: number): Line {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(new Float32Array(3 * points), 3));
    const line = new Line(geometry, new LineBasicMaterial({ color: colour, transparent: true, opacity }));
    line.frustumCulled = false;
    return line;
  }

  /** Where the motion takes place, and where its ground lies. */
  private measure(): void {
    const { points, frames, joints } = this.motion;
    const low = [Infinity, Infinity], high = [-Infinity, -Infinity], lows: number[] = [];
    for (let f = 0; f < frames; f++) {
      let lowest = Infinity;
      for (let j = 0; j < joints; j++) lowest = Math.min(lowest, points[3 * (f * joints + j) + 1]!);
      lows.push(lowest);
      [0, 2].forEach((axis, i) => {
        const v = points[3 * f * joints + axis]!;
        low[i] = Math.min(low[i]!, v); high[i] = Math.max(high[i]!, v);
      });
    }
    this.floor = lows.sort((a, b) => a - b)[Math.floor(0.05 * frames)] ?? 0;
    this.middle.set((low[0]! + high[0]!) / 2, this.floor, (low[1]! + high[1]!) / 2);
    this.reach = Math.hypot(high[0]! - low[0]!, high[1]! - low[1]!) / 2;
    const every = Math.max(1, Math.ceil(frames / 2000)), position = this.path.geometry.getAttribute("position") as BufferAttribute;
    let n = 0;
    for (let f = 0; f < frames && n < position.count; f += every) {
      const i = 3 * f * joints;
      position.setXYZ(n++, points[i]!, this.floor + 0.004, points[i + 2]!);
    }
    this.path.geometry.setDrawRange(0, n);
    this.shadow.position.y = this.floor + 0.002;
  }

  paint(colours: Colours): void {
    this.scene.background = new Color(colours.panel);
    this.flat.color.set(new Color(colours.panel).lerp(new Color(colours.dark ? "#000000" : colours.ink), colours.dark ? 0.55 : 0.22));
    if (this.grid) { this.scene.remove(this.grid); this.grid.dispose(); }
    const size = 2 * Math.ceil(Math.min(40, this.reach + 4));
    this.grid = new GridHelper(size, size, colours.edge, colours.edge);
    this.grid.position.set(Math.round(this.middle.x), this.floor, Math.round(this.middle.z));
    this.scene.add(this.grid);
  }

  place(frame: number, joint: number, into: Vector3): Vector3 {
    const i = 3 * (frame * this.motion.joints + joint), p = this.motion.points;
    return into.set(p[i]!, p[i + 1]!, p[i + 2]!);
  }

  pose(seconds: number, shows: Shows): void {
    const { motion, about } = this;
    const head = about.joints.indexOf("head");
    const frame = Math.min(motion.frames - 1, Math.max(0, Math.floor(seconds * motion.fps + 1e-6)));
    const a = new Vector3(), b = new Vector3(), along = new Vector3(), turn = new Quaternion(), matrix = new Matrix4(), scale = new Vector3();
    for (const [i, [p, j]] of this.links.entries()) {
      this.place(frame, p, a);
      this.place(frame, j, b);
      along.subVectors(b, a);
      const length = along.length();
      if (length < 1e-5) { this.bones.setMatrixAt(i, NOWHERE); continue; }
      turn.setFromUnitVectors(UP, along.divideScalar(length));
      const radius = about.radii[j]! * (j === head ? 0.5 : 1);
      this.bones.setMatrixAt(i, matrix.compose(a.add(b).multiplyScalar(0.5), turn, scale.set(radius, length, radius)));
    }
    turn.identity();
    for (let j = 0; j < motion.joints; j++) {
      const radius = about.radii[j]! * (j === head ? 1.12 : 1);
      this.joints.setMatrixAt(j, matrix.compose(this.place(frame, j, a), turn, scale.setScalar(radius)));
    }
    this.bones.instanceMatrix.needsUpdate = true;
    this.joints.instanceMatrix.needsUpdate = true;
    this.discs.forEach((disc, foot) => {
      disc.visible = shows.contacts && Boolean((motion.contacts[frame] ?? 0) & (1 << foot)) && this.feet[foot]!.length > 0;
      if (!disc.visible) return;
      a.set(0, 0, 0);
      for (const j of this.feet[foot]!) a.add(this.place(frame, j, b));
      a.divideScalar(this.feet[foot]!.length);
      disc.position.set(a.x, this.floor + 0.006, a.z);
    });
    for (const { line, joint } of this.trails) {
      line.visible = shows.trails;
      if (!shows.trails) continue;
      const position = line.geometry.getAttribute("position") as BufferAttribute;
      const first = Math.max(0, frame - Math.round(TRAIL * motion.fps));
      for (let f = first; f <= frame; f++) { this.place(f, joint, a); position.setXYZ(f - first, a.x, a.y, a.z); }
      position.needsUpdate = true;
      line.geometry.setDrawRange(0, frame - first + 1);
    }
    this.path.visible = shows.path;
    if (this.grid) this.grid.visible = shows.ground;
    this.current = frame;
  }
  current = 0;

  dispose(): void {
    this.scene.traverse((object) => {
      const mesh = object as Mesh;
      mesh.geometry?.dispose();
      if (mesh.material) for (const material of [mesh.material].flat()) material.dispose();
    });
    for (const mesh of [this.bones, this.joints]) mesh.dispose();
  }
}

export class Stage {
  private renderer: WebGLRenderer;
  private camera = new PerspectiveCamera(36, 1, 0.05, 200);
  private bodies: (Body | null)[] = [];
  private keys: string[] = [];
  readonly view = { ...HOME, follow: true };

  constructor(private canvas: HTMLCanvasElement, private about: Skeleton, private colours: Colours) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, powerPreference: "high-performance" });
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
    this.renderer.setScissorTest(true);
  }

  /** `keys` say which motion is which, so that a body that stays is not made anew. */
  show(motions: (Motion | null)[], keys: string[]): void {
    this.bodies.forEach((body, i) => { if (body && (keys[i] !== this.keys[i] || motions[i] !== body.motion)) body.dispose(); });
    this.bodies = motions.map((motion, i) => {
      const same = this.bodies[i];
      if (!motion || !motion.frames) return null;
      return same && keys[i] === this.keys[i] && same.motion === motion ? same : new Body(motion, this.about, this.colours);
    });
    this.keys = keys;
  }

  paint(colours: Colours): void {
    this.colours = colours;
    const motions = this.bodies.map((body) => body?.motion ?? null);
    this.bodies.forEach((body) => body?.dispose());
    this.bodies = motions.map((motion) => motion && new Body(motion, this.about, colours));
  }

  turn(across: number, up: number): void {
    this.view.turn += across;
    this.view.tilt = Math.min(1.5, Math.max(-0.1, this.view.tilt + up));
  }
  zoom(by: number): void {
    this.view.zoom = Math.min(8, Math.max(0.15, this.view.zoom * by));
  }
  home(): void {
    Object.assign(this.view, HOME);
  }

  draw(times: readonly number[], shows: Shows): void {
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    if (!width || !height) return;
    const ratio = this.renderer.getPixelRatio();
    if (this.canvas.width !== Math.floor(width * ratio) || this.canvas.height !== Math.floor(height * ratio)) this.renderer.setSize(width, height, false);
    const count = Math.max(1, this.bodies.length);
    const columns = count === 4 ? 2 : count, rows = Math.ceil(count / columns);
    const w = width / columns, h = height / rows;
    const target = new Vector3();
    const reach = Math.max(...this.bodies.map((body) => body?.reach ?? 0));
    this.bodies.forEach((body, i) => {
      const x = (i % columns) * w, y = height - (Math.floor(i / columns) + 1) * h;
      const edge = columns > 1 ? 2 : 0;
      this.renderer.setViewport(x, y, w - edge, h - (rows > 1 ? 2 : 0));
      this.renderer.setScissor(x, y, w - edge, h - (rows > 1 ? 2 : 0));
      if (!body) {
        this.renderer.setClearColor(new Color(this.colours.panel));
        this.renderer.clear();
        return;
      }
      body.pose(times[i] ?? 0, shows);
      if (this.view.follow) body.place(body.current, 0, target); else target.copy(body.middle);
      target.y = body.middle.y + 0.88;
      const away = ((this.view.follow ? 3.6 : 3.6 + 1.9 * reach) * Math.max(1, (0.75 * h) / w)) / this.view.zoom;
      const { turn, tilt } = this.view;
      this.camera.position.set(
        target.x + away * Math.cos(tilt) * Math.sin(turn), target.y + away * Math.sin(tilt), target.z + away * Math.cos(tilt) * Math.cos(turn),
      );
      this.camera.lookAt(target);
      this.camera.aspect = w / h;
      this.camera.updateProjectionMatrix();
      this.renderer.render(body.scene, this.camera);
    });
  }

  dispose(): void {
    this.bodies.forEach((body) => body?.dispose());
    this.renderer.dispose();
  }
}
