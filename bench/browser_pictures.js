/* Stick figures drawn on canvases of their own, and by WebGL on one canvas with a part of it for each: milliseconds a picture of all. */
async ([count, rounds, width, height]) => {
  const bones = 20, clips = Array.from({ length: count }, (_, c) => Float32Array.from({ length: bones * 4 }, (_, i) => 0.5 + 0.45 * Math.sin(i * 7.3 + c)));
  const box = document.createElement("div");
  box.style.cssText = "position:fixed;inset:0;z-index:99";
  document.body.append(box);
  const frame = () => new Promise(requestAnimationFrame);
  const middle = (values) => values.sort((a, b) => a - b)[values.length >> 1];
  const canvases = clips.map(() => Object.assign(document.createElement("canvas"), { width, height }));
  box.append(...canvases);
  const plain = canvases.map((canvas) => canvas.getContext("2d"));
  const flat = [];
  for (let r = 0; r < rounds; r++) {
    await frame();
    const start = performance.now();
    plain.forEach((ctx, c) => {
      ctx.clearRect(0, 0, width, height);
      ctx.lineWidth = 4;
      ctx.beginPath();
      for (let b = 0; b < bones; b++) {
        const [x, y, u, v] = clips[c].subarray(4 * b, 4 * b + 4);
        ctx.moveTo(x * width, y * height);
        ctx.lineTo((x + 0.1 * Math.cos(r / 9 + u)) * width, (y + 0.1 * Math.sin(r / 9 + v)) * height);
      }
      ctx.stroke();
    });
    for (const ctx of plain) ctx.getImageData(0, 0, 1, 1); // so that all are drawn
    flat.push(performance.now() - start);
  }
  canvases.forEach((canvas) => canvas.remove());
  const columns = 8, rows = Math.ceil(count / columns);
  const shared = Object.assign(document.createElement("canvas"), { width: columns * width, height: rows * height });
  box.append(shared);
  const gl = shared.getContext("webgl2", { antialias: true });
  const shader = (kind, text) => { const s = gl.createShader(kind); gl.shaderSource(s, text); gl.compileShader(s); return s; };
  const program = gl.createProgram();
  gl.attachShader(program, shader(gl.VERTEX_SHADER, "#version 300 es\nin vec2 place;void main(){gl_Position=vec4(place*2.0-1.0,0,1);}"));
  gl.attachShader(program, shader(gl.FRAGMENT_SHADER, "#version 300 es\nprecision mediump float;out vec4 c;void main(){c=vec4(0,0.4,0.7,1);}"));
  gl.linkProgram(program);
  gl.useProgram(program);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.enableVertexAttribArray(0);
  gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
  gl.enable(gl.SCISSOR_TEST);
  const corners = new Float32Array(bones * 12), pixel = new Uint8Array(4), lit = [];
  for (let r = 0; r < rounds; r++) {
    await frame();
    const start = performance.now();
    clips.forEach((clip, c) => {
      const left = (c % columns) * width, low = Math.floor(c / columns) * height;
      gl.viewport(left, low, width, height);
      gl.scissor(left, low, width, height);
      gl.clear(gl.COLOR_BUFFER_BIT);
      for (let b = 0; b < bones; b++) {
        const [x, y, u, v] = clip.subarray(4 * b, 4 * b + 4);
        const [dx, dy] = [0.1 * Math.cos(r / 9 + u), 0.1 * Math.sin(r / 9 + v)], far = Math.hypot(dx, dy) || 1;
        const [nx, ny] = [(-dy / far) * 0.015, (dx / far) * 0.015];
        corners.set([x + nx, y + ny, x - nx, y - ny, x + dx + nx, y + dy + ny, x + dx + nx, y + dy + ny, x - nx, y - ny, x + dx - nx, y + dy - ny], 12 * b);
      }
      gl.bufferData(gl.ARRAY_BUFFER, corners, gl.STREAM_DRAW);
      gl.drawArrays(gl.TRIANGLES, 0, bones * 6);
    });
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel); // so that it is drawn
    lit.push(performance.now() - start);
  }
  box.remove();
  const info = gl.getExtension("WEBGL_debug_renderer_info");
  return { canvas_ms: middle(flat), webgl_ms: middle(lit), drawn_by: info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : "" };
}
