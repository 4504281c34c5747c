/* What may be shown with a body: where feet stand, trails, other moments, the other clips in the same place. */
const TRAIL = 1.2; // seconds
const SKIN = [-0.4, -0.2, 0.2, 0.4]; // seconds before and after
const shows = { body: "sticks", contacts: false, trails: false, onion: false, overlay: false, curves: false };

function drawContacts(ctx, project, pane, frame) {
  pane.stands ??= standing(pane);
  page.feet.forEach((joint, i) => {
    if (!pane.stands[i][frame]) return;
    let first = frame;
    while (first > 0 && pane.stands[i][first - 1]) first--;
    const place = below(pane.joint(frame, joint)), dot = project(place);
    if (!dot) return;
    const wide = 0.045 * pane.clip.height * dot.scale, high = wide * Math.max(0.2, Math.abs(Math.sin(camera.tilt)));
    ctx.fillStyle = colours.contact;
    ctx.globalAlpha = 0.75;
    ctx.beginPath();
    ctx.ellipse(dot.x, dot.y, wide, high, 0, 0, 7);
    ctx.fill();
    ctx.globalAlpha = 1;
    // How far it slid since it stands.
    const slid = Array.from({ length: frame - first + 1 }, (_, k) => below(pane.joint(first + k, joint)));
    stroke(ctx, project, [slid], colours.contact, 2.5, 1);
  });
}

function drawTrails(ctx, project, pane, frame) {
  const first = Math.max(0, frame - Math.round(TRAIL * pane.clip.fps));
  const middle = Math.floor((first + frame) / 2);
  for (const joint of page.trails) {
    const colour = colours[page.sides[joint]];
    const line = (a, b) => [Array.from({ length: b - a + 1 }, (_, k) => pane.joint(a + k, joint))];
    stroke(ctx, project, line(first, middle), colour, 1.5, 0.35);
    stroke(ctx, project, line(middle, frame), colour, 2, 0.8);
  }
}

function drawOnion(ctx, project, pane, frame) {
  for (const seconds of SKIN) {
    const then = frame + Math.round(seconds * pane.clip.fps);
    if (then < 0 || then >= pane.clip.count) continue;
    const look = { alpha: Math.abs(seconds) > 0.3 ? 0.18 : 0.35, colour: seconds < 0 ? colours.faint : colours.accent };
    drawBody(ctx, project, pane, then, { ...look, thin: true });
  }
}

/* The other clips where the first one is: each begins at the same place and faces the same way. */
function drawOthers(ctx, project) {
  panes.slice(1).forEach((other, i) => {
    const look = { alpha: 0.6, colour: colours[`clip${i + 1}`], thin: true };
    drawBody(ctx, project, other, other.frame(seconds()), look);
  });
}
