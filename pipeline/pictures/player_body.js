/* A body as sticks or as capsules. */
const THICK = { // radius of a bone by the joint at its end, share of the body's height
  spine: 0.062, chest: 0.07, neck: 0.055, head: 0.026, clavicle: 0.032, shoulder: 0.036, elbow: 0.027, wrist: 0.022,
  hip: 0.055, knee: 0.044, ankle: 0.032, toe: 0.024,
};
const bones = page.parents.map((p, j) => ({ j, p, thick: THICK[page.names[j].replace(/^(left|right)_/, "")] }))
  .filter(({ p }) => p >= 0);

/* The bones and the head [{depth, …}] of a frame, far ones first. */
function limbs(project, pane, frame) {
  const joints = page.parents.map((_, j) => pane.joint(frame, j));
  const seen = joints.map(project);
  const [head, neck] = [joints[page.head], joints[page.neck]];
  const crown = project(head.map((v, i) => v + 0.25 * (v - neck[i])));
  const found = bones
    .filter(({ j, p }) => seen[j] && seen[p])
    .map((bone) => ({ ...bone, from: seen[bone.p], to: seen[bone.j], depth: (seen[bone.j].depth + seen[bone.p].depth) / 2 }));
  if (crown) found.push({ depth: crown.depth, crown });
  return found.sort((a, b) => b.depth - a.depth);
}

function drawShadow(ctx, project, pane, frame) {
  const joints = page.parents.map((_, j) => below(pane.joint(frame, j)));
  const root = project(joints[0]);
  const width = (shows.body === "capsules" ? 0.07 : 0.03) * pane.clip.height;
  if (root) stroke(ctx, project, bones.map(({ j, p }) => [joints[p], joints[j]]), colours.ink, width * root.scale, 0.13);
}

/* `look`: {alpha, colour} of a ghost; the body itself without. */
function drawBody(ctx, project, pane, frame, look = {}) {
  const tall = pane.clip.height;
  ctx.globalAlpha = look.alpha ?? 1;
  const solid = shows.body === "capsules" && !look.thin;
  for (const limb of limbs(project, pane, frame)) {
    if (solid) drawCapsule(ctx, limb, tall, look.colour);
    else drawStick(ctx, limb, tall, look.colour);
  }
  ctx.globalAlpha = 1;
}

function drawStick(ctx, limb, tall, colour) {
  ctx.beginPath();
  if (limb.crown) {
    ctx.arc(limb.crown.x, limb.crown.y, 0.055 * tall * limb.crown.scale, 0, 7);
    ctx.fillStyle = colours.panel;
    if (!colour) ctx.fill();
    ctx.strokeStyle = colour ?? colours.ink;
    ctx.lineWidth = Math.max(1, 0.012 * tall * limb.crown.scale);
  } else {
    ctx.moveTo(limb.from.x, limb.from.y);
    ctx.lineTo(limb.to.x, limb.to.y);
    ctx.strokeStyle = colour ?? colours[page.sides[limb.j]];
    ctx.lineWidth = Math.max(1.2, 0.02 * tall * limb.to.scale);
  }
  ctx.stroke();
}

/* A cylinder with round ends, lit from above the viewer: its colour across, darker at the edges. */
function drawCapsule(ctx, limb, tall, colour) {
  if (limb.crown) {
    const { x, y, scale } = limb.crown, radius = 0.062 * tall * scale;
    const light = ctx.createRadialGradient(x - radius / 3, y - radius / 3, radius / 8, x, y, radius);
    shaded(light, colour ?? colours.body);
    ctx.fillStyle = light;
    ctx.beginPath();
    ctx.arc(x, y, radius, 0, 7);
    ctx.fill();
    return;
  }
  const { from, to } = limb, own = colour ?? (page.sides[limb.j] === "ink" ? colours.body : colours[page.sides[limb.j]]);
  const radius = limb.thick * tall * (from.scale + to.scale) / 2;
  const [dx, dy] = [to.x - from.x, to.y - from.y], length = Math.hypot(dx, dy) || 1;
  let [nx, ny] = [(-dy / length) * radius, (dx / length) * radius];
  if (nx + ny > 0) [nx, ny] = [-nx, -ny]; // light falls from above, on the left
  const light = ctx.createLinearGradient(from.x + nx, from.y + ny, from.x - nx, from.y - ny);
  shaded(light, own);
  ctx.strokeStyle = light;
  ctx.lineWidth = 2 * radius;
  ctx.beginPath();
  ctx.moveTo(from.x, from.y);
  ctx.lineTo(to.x, to.y + (length === 1 ? 0.01 : 0));
  ctx.stroke();
}

function shaded(light, colour) {
  for (const [at, by] of [[0, 1.15], [0.3, 1.3], [0.75, 0.85], [1, 0.55]]) light.addColorStop(at, lit(colour, by));
}

/* A colour #rrggbb made lighter or darker. */
function lit(colour, by) {
  const parts = [1, 3, 5].map((i) => parseInt(colour.slice(i, i + 2), 16));
  return `rgb(${parts.map((v) => Math.round(by > 1 ? v + (255 - v) * (by - 1) : v * by)).join(" ")})`;
}
