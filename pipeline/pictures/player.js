"use strict";
(() => {
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

  const colours = {};
  function readColours() {
    const style = getComputedStyle(document.documentElement);
    for (const name of ["ink", "faint", "left", "right", "panel"]) {
      colours[name] = style.getPropertyValue(`--${name}`).trim();
    }
  }

  /* Pixels of a point, and how many pixels a metre takes there; null behind the viewer. */
  function lens(target, width, height) {
    const [ct, st, cp, sp] = [Math.cos(camera.turn), Math.sin(camera.turn), Math.cos(camera.tilt), Math.sin(camera.tilt)];
    const tall = Math.max(...panes.map((p) => p.clip.height));
    const wide = camera.follow ? 0 : Math.max(...panes.map((p) => p.reach));
    const away = (2.9 * tall + 2.4 * wide) / camera.zoom;
    const focus = 2.05 * Math.min(height, width * 1.15);
    return ([x, y, z]) => {
      [x, y, z] = [x - target[0], y - target[1], z - target[2]];
      const across = x * ct - z * st, near = x * st + z * ct;
      const up = y * cp - near * sp, depth = away - (near * cp + y * sp);
      if (depth < 0.05) return null;
      const scale = focus / depth;
      return { x: width / 2 + across * scale, y: height / 2 - up * scale, scale, depth };
    };
  }

  /* Lines through points, in one stroke so that they do not darken one another; not behind the viewer. */
  function stroke(ctx, project, lines, colour, width, alpha) {
    Object.assign(ctx, { strokeStyle: colour, lineWidth: width, globalAlpha: alpha });
    ctx.beginPath();
    for (const points of lines) {
      let pen = false;
      for (const p of points.map(project)) {
        if (p) ctx[pen ? "lineTo" : "moveTo"](p.x, p.y);
        pen = Boolean(p);
      }
    }
    ctx.stroke();
    ctx.globalAlpha = 1;
  }

  const below = ([x, , z]) => [x, 0, z];

  function drawGround(ctx, project, target, reach) {
    const step = reach > 12 ? 2 : reach > 6 ? 1 : 0.5;
    const cells = Math.ceil(reach / step);
    const x0 = Math.round(target[0] / step), z0 = Math.round(target[2] / step);
    const levels = [[], [], [], []];
    for (let i = -cells; i <= cells; i++) {
      for (let j = -cells; j < cells; j++) {
        for (const cross of [false, true]) {
          const ends = [j, j + 1].map((k) => (cross ? [x0 + k, z0 + i] : [x0 + i, z0 + k]));
          const off = ends.map(([x, z]) => Math.hypot(x * step - target[0], z * step - target[2]));
          const level = Math.floor(4 * (1 - (off[0] + off[1]) / 2 / reach));
          if (level >= 0) levels[Math.min(3, level)].push(ends.map(([x, z]) => [x * step, 0, z * step]));
        }
      }
    }
    levels.forEach((lines, level) => stroke(ctx, project, lines, colours.faint, 1, 0.08 + 0.1 * level));
  }

  function drawPath(ctx, project, pane, frame) {
    const every = Math.max(1, Math.floor(pane.clip.count / 900));
    const place = (f) => below(pane.joint(f, 0));
    const upTo = (f) => [...Array.from({ length: Math.ceil(f / every) }, (_, i) => place(i * every)), place(f)];
    stroke(ctx, project, [upTo(pane.clip.count - 1)], colours.faint, 1.5, 0.45);
    stroke(ctx, project, [upTo(frame)], colours.faint, 2.5, 1);
    const dot = project(place(frame));
    if (dot) {
      ctx.fillStyle = colours.faint;
      ctx.beginPath();
      ctx.ellipse(dot.x, dot.y, 0.035 * dot.scale, 0.035 * dot.scale * Math.max(0.15, Math.abs(Math.sin(camera.tilt))), 0, 0, 7);
      ctx.fill();
    }
  }

  function drawBody(ctx, project, pane, frame) {
    const joints = page.parents.map((_, j) => pane.joint(frame, j));
    const tall = pane.clip.height;
    const bones = page.parents.map((p, j) => [j, p]).filter(([, p]) => p >= 0);
    const root = project(below(joints[0]));
    const shadow = bones.map(([j, p]) => [joints[p], joints[j]].map(below));
    if (root) stroke(ctx, project, shadow, colours.ink, 0.03 * tall * root.scale, 0.13);
    const seen = joints.map(project);
    const [head, neck] = [joints[page.head], joints[page.neck]];
    const crown = project(head.map((v, i) => v + 0.25 * (v - neck[i])));
    const drawn = bones
      .filter(([j, p]) => seen[j] && seen[p])
      .map(([j, p]) => ({ depth: (seen[j].depth + seen[p].depth) / 2, j, p }));
    if (crown) drawn.push({ depth: crown.depth, head: true });
    drawn.sort((a, b) => b.depth - a.depth);
    for (const bone of drawn) {
      ctx.beginPath();
      if (bone.head) {
        ctx.arc(crown.x, crown.y, 0.055 * tall * crown.scale, 0, 7);
        ctx.fillStyle = colours.panel;
        ctx.fill();
        ctx.strokeStyle = colours.ink;
        ctx.lineWidth = Math.max(1, 0.012 * tall * crown.scale);
      } else {
        const [a, b] = [seen[bone.p], seen[bone.j]];
        ctx.moveTo(a.x, a.y);
        ctx.lineTo(b.x, b.y);
        ctx.strokeStyle = colours[page.sides[bone.j]];
        ctx.lineWidth = Math.max(1.2, 0.02 * tall * b.scale);
      }
      ctx.stroke();
    }
  }

  function drawPane(pane) {
    const { canvas } = pane;
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const size = [Math.round(width * ratio), Math.round(height * ratio)];
    if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;
    const frame = pane.frame(seconds());
    const [x, , z] = camera.follow ? pane.joint(frame, 0) : pane.middle;
    const target = [x, 0.5 * pane.clip.height, z];
    const ctx = canvas.getContext("2d");
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.clearRect(0, 0, width, height);
    ctx.lineCap = "round";
    const project = lens(target, width, height);
    drawGround(ctx, project, target, camera.follow ? 4 : 4 + pane.reach);
    drawPath(ctx, project, pane, frame);
    drawBody(ctx, project, pane, frame);
    const own = pane.clip.first + frame * pane.clip.step;
    const time = frame / pane.clip.fps;
    const spans = pane.clip.bands.flatMap((band) => band.spans);
    const labels = spans.filter((s) => s.start <= time + 1e-6 && time + 1e-6 < s.stop).map((s) => s.shown);
    const over = !stretched() && seconds() >= pane.seconds ? ["ended"] : [];
    pane.now.textContent = [...over, `frame ${own}`, `${time.toFixed(2)} s`, ...new Set(labels)].join(" · ");
    return own;
  }

  function draw() {
    const shown = panes.map(drawPane);
    at("time").textContent =
      `frame ${shown[0]} of ${first.clip.frames} · ${seconds().toFixed(2)} s of ${whole().toFixed(2)} s`;
    at("scrub").max = steps() - 1;
    at("scrub").value = frame();
    at("scrub").setAttribute("aria-valuetext", at("time").textContent);
    if (at("needle")) at("needle").style.left = `${(100 * frame()) / Math.max(1, steps() - 1)}%`;
  }

  let asked = false;
  function redraw() {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => { asked = false; draw(); });
  }

  function seek(to) {
    moment = within(to, 0, steps() - 1);
    redraw();
  }

  let last = 0;
  function tick(time) {
    if (!playing) return;
    moment += ((time - last) / 1000) * Number(at("speed").value) * first.clip.fps;
    last = time;
    if (moment >= steps()) {
      if (at("loop").checked) moment %= steps();
      else { moment = steps() - 1; play(false); }
    }
    draw();
    requestAnimationFrame(tick);
  }

  function play(on) {
    if (on === playing) return;
    playing = on;
    at("play").textContent = on ? "Pause" : "Play";
    if (!on) return seek(frame());
    if (moment >= steps() - 1) moment = 0;
    requestAnimationFrame((time) => { last = time; requestAnimationFrame(tick); });
  }

  function turn(across, up) {
    camera.turn += across;
    camera.tilt = within(camera.tilt + up, -0.1, 1.5);
    redraw();
  }
  function zoom(by) {
    camera.zoom = within(camera.zoom * by, 0.15, 8);
    redraw();
  }
  function home() {
    Object.assign(camera, HOME);
    redraw();
  }

  for (const { canvas } of panes) {
    const fingers = new Map();
    let apart = 0;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      canvas.classList.add("turning");
      apart = 0;
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      if (fingers.size === 1) turn((before[0] - event.clientX) * 0.01, (event.clientY - before[1]) * 0.01);
      else {
        const [a, b] = [...fingers.values()];
        const now = Math.hypot(a[0] - b[0], a[1] - b[1]);
        if (apart && now) zoom(now / apart);
        apart = now;
      }
    });
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, (event) => {
        fingers.delete(event.pointerId);
        apart = 0;
        if (!fingers.size) canvas.classList.remove("turning");
      });
    }
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      zoom(Math.exp(-within(event.deltaY, -300, 300) * 0.0015));
    }, { passive: false });
    canvas.addEventListener("dblclick", home);
    canvas.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[event.key];
      if (!by || event.shiftKey || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      event.stopPropagation();
      turn(...by);
    });
    new ResizeObserver(redraw).observe(canvas);
  }

  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === "SELECT") return;
    const far = event.shiftKey ? Math.round(first.clip.fps) : 1;
    const act = {
      ArrowLeft: () => seek(frame() - far),
      ArrowRight: () => seek(frame() + far),
      Home: () => seek(0),
      End: () => seek(steps() - 1),
      f: () => at("follow").click(),
      r: home,
      "+": () => zoom(1.15),
      "=": () => zoom(1.15),
      "-": () => zoom(1 / 1.15),
      " ": () => play(!playing),
    }[event.key];
    if (!act) return;
    const own = event.target.closest("button, summary, input[type=checkbox]"); // space presses these
    if (event.key === " " && own) return;
    event.preventDefault();
    act();
  });

  at("play").addEventListener("click", () => play(!playing));
  at("scrub").addEventListener("input", () => { play(false); seek(Number(at("scrub").value)); });
  at("follow").addEventListener("change", () => { camera.follow = at("follow").checked; redraw(); });
  at("home").addEventListener("click", home);
  if (at("stretch")) at("stretch").addEventListener("change", () => { seek(moment); placeBands(); });

  const items = [];
  for (const list of document.querySelectorAll(".bands ul")) {
    const pane = panes[Number(list.dataset.pane)];
    const { spans, lanes } = pane.clip.bands[Number(list.dataset.band)];
    list.style.height = `${BAND * lanes}px`;
    for (const span of spans) {
      const item = document.createElement("li");
      item.textContent = span.shown;
      item.title = `${span.shown}, ${span.start.toFixed(2)} to ${span.stop.toFixed(2)} s`;
      Object.assign(item.style, { top: `${BAND * span.lane}px`, background: span.colour, color: span.ink });
      item.addEventListener("click", () => seek(Math.ceil(span.start * pane.pace() * first.clip.fps - 1e-6)));
      list.append(item);
      items.push({ item, span, pane });
    }
  }
  function placeBands() {
    const step = 1 / first.clip.fps;
    const whole = Math.max(step, length() - step); // the last frame stands at the end of the bar
    for (const { item, span, pane } of items) {
      const [start, stop] = [span.start * pane.pace(), Math.min(span.stop * pane.pace(), whole)];
      item.style.left = `${(100 * start) / whole}%`;
      item.style.width = `${(100 * Math.max(0, stop - start)) / whole}%`;
    }
  }

  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { readColours(); redraw(); });
  readColours();
  placeBands();
  draw();
})();
