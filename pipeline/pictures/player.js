/* The page: what is drawn when, and what keys, mouse and fingers do. */
function drawPane(pane) {
  const [ctx, width, height] = sized(pane.canvas);
  const frame = pane.frame(seconds());
  const [x, , z] = camera.follow ? pane.joint(frame, 0) : pane.middle;
  const target = [x, 0.5 * pane.clip.height, z];
  ctx.lineCap = "round";
  const project = lens(target, width, height);
  drawGround(ctx, project, target, camera.follow ? 4 : 4 + pane.reach);
  drawPath(ctx, project, pane, frame);
  drawShadow(ctx, project, pane, frame);
  if (shows.contacts) drawContacts(ctx, project, pane, frame);
  if (shows.onion) drawOnion(ctx, project, pane, frame);
  if (shows.trails) drawTrails(ctx, project, pane, frame);
  if (shows.overlay && pane === first) drawOthers(ctx, project);
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
  drawCurves();
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
    b: () => at("body").click(),
    c: () => at("contacts").click(),
    t: () => at("trails").click(),
    n: () => at("onion").click(),
    o: () => at("overlay")?.click(),
    j: () => at("curved").click(),
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
at("body").addEventListener("change", () => { shows.body = at("body").checked ? "capsules" : "sticks"; redraw(); });
for (const [id, name] of [["contacts"], ["trails"], ["onion"], ["overlay"], ["curved", "curves"]]) {
  at(id)?.addEventListener("change", () => { shows[name ?? id] = at(id).checked; redraw(); });
}
for (const id of ["joint", "measure"]) at(id).addEventListener("change", redraw);
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
