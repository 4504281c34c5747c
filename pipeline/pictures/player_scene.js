/* The ground and what lies on it, as the camera sees it. */
const colours = {};
function readColours() {
  const style = getComputedStyle(document.documentElement);
  const names = ["ink", "faint", "left", "right", "panel", "accent", "body", "contact", "clip0", "clip1", "clip2", "clip3"];
  for (const name of names) {
    colours[name] = style.getPropertyValue(`--${name}`).trim();
  }
}

/* The context of a canvas of its size on the page, cleared, and that size. */
function sized(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  const size = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;
  const ctx = canvas.getContext("2d");
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  ctx.clearRect(0, 0, width, height);
  return [ctx, width, height];
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
