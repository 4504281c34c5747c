/* Curves of a joint in time, a line for each clip. */
const MEASURES = {
  height: { unit: "m", of: (pane, f, joint) => pane.joint(f, joint)[1] },
  speed: { unit: "m/s", of: (pane, f, joint) => apart(pane, f, joint, (p) => p) },
  "ground speed": { unit: "m/s", of: (pane, f, joint) => apart(pane, f, joint, below) },
};

/* Metres a second that a joint goes about a frame. */
function apart(pane, frame, joint, seen) {
  const last = pane.clip.count - 1, [low, high] = [Math.max(0, frame - 1), Math.min(last, frame + 1)];
  if (low === high) return 0;
  const [a, b] = [low, high].map((f) => seen(pane.joint(f, joint)));
  return (Math.hypot(...a.map((v, i) => b[i] - v)) * pane.clip.fps) / (high - low);
}

/* The canvas of the curves, made when they are first asked for. */
function curveCanvas() {
  if (at("curve")) return at("curve");
  const canvas = document.createElement("canvas");
  canvas.id = "curve";
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", "Curves of the joint; click to go to a moment");
  canvas.addEventListener("click", (event) => {
    const { left, width } = canvas.getBoundingClientRect();
    play(false);
    seek(Math.round(((event.clientX - left - 7) / (width - 14)) * (steps() - 1)));
  });
  at("curves").append(canvas);
  new ResizeObserver(redraw).observe(canvas);
  return canvas;
}

const curves = { key: "", lines: [], high: 1 };

function curveLines() {
  const [joint, measure] = [Number(at("joint").value), at("measure").value];
  const key = `${joint} ${measure}`;
  if (curves.key !== key) {
    const { of } = MEASURES[measure];
    curves.lines = panes.map((pane) => Array.from({ length: pane.clip.count }, (_, f) => of(pane, f, joint)));
    curves.high = Math.max(0.1, ...curves.lines.map((line) => line.reduce((a, b) => Math.max(a, b), 0)));
    curves.key = key;
  }
  return curves.lines;
}

function drawCurves() {
  at("curves").hidden = !shows.curves;
  if (!shows.curves) return;
  const [ctx, width, height] = sized(curveCanvas());
  const lines = curveLines(), { unit } = MEASURES[at("measure").value];
  const [left, low, high] = [7, height - 6, 16]; // as the bands: half a thumb
  const span = width - 2 * left;
  ctx.font = "12px system-ui, sans-serif";
  ctx.fillStyle = colours.faint;
  ctx.strokeStyle = colours.faint;
  ctx.globalAlpha = 0.35;
  ctx.lineWidth = 1;
  ctx.beginPath();
  for (const y of [low, high]) { ctx.moveTo(left, y); ctx.lineTo(width - left, y); }
  ctx.stroke();
  ctx.globalAlpha = 1;
  ctx.fillText(`${curves.high.toFixed(2)} ${unit}`, left, 12);
  const whole = Math.max(1, steps() - 1) / first.clip.fps;
  lines.forEach((line, i) => {
    const pane = panes[i];
    ctx.strokeStyle = colours[`clip${i}`];
    ctx.lineWidth = 1.8;
    ctx.beginPath();
    line.forEach((value, f) => {
      const x = left + (span * (f / pane.clip.fps) * pane.pace()) / whole;
      ctx[f ? "lineTo" : "moveTo"](x, low - ((low - high) * value) / curves.high);
    });
    ctx.stroke();
  });
  const x = left + (span * frame()) / Math.max(1, steps() - 1);
  ctx.strokeStyle = colours.ink;
  ctx.lineWidth = 2;
  ctx.beginPath();
  ctx.moveTo(x, 0);
  ctx.lineTo(x, height);
  ctx.stroke();
  at("values").textContent = panes
    .map((pane, i) => `${panes.length > 1 ? `${i + 1}: ` : ""}${lines[i][pane.frame(seconds())].toFixed(2)} ${unit}`).join("  ");
}
