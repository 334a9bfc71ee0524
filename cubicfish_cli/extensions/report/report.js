"use strict";
const byId = (id) => document.getElementById(id);
const acts = JSON.parse(byId("acts").textContent), rad = Math.PI / 180;
const within = (low, x, high) => Math.max(low, Math.min(high, x));

// A drag turns by so many pixels, the wheel zooms by a factor; keys do both.
function turnable(canvas, turn) {
  let last = {};
  canvas.onpointerdown = (e) => {
    canvas.setPointerCapture(e.pointerId);
    last = e;
  };
  canvas.onpointermove = (e) => {
    if (!canvas.hasPointerCapture(e.pointerId) || last.pointerId !== e.pointerId) return;
    turn(e.clientX - last.clientX, e.clientY - last.clientY, 1);
    last = e;
  };
  canvas.addEventListener("wheel", (e) => {
    e.preventDefault();
    turn(0, 0, Math.exp(within(-1, e.deltaY / 500, 1)));
  }, { passive: false });
  const keys = {
    ArrowLeft: [20, 0, 1], ArrowRight: [-20, 0, 1], ArrowUp: [0, 20, 1], ArrowDown: [0, -20, 1],
    "+": [0, 0, 0.9], "-": [0, 0, 1 / 0.9],
  };
  canvas.onkeydown = (e) => {
    if (!keys[e.key]) return;
    e.preventDefault();
    turn(...keys[e.key]);
  };
}

// Photos are sorted, and left out.
const rows = [...byId("rows").rows], buttons = [...byId("sorting").querySelectorAll("button")];
const gone = () => rows.filter((row) => !row.querySelector("input").checked);
let turnScene = () => {};
for (const row of rows) {
  const box = row.querySelector("input");
  box.hidden = false;
  box.onchange = () => {
    const card = byId("without");
    card.hidden = !gone().length;
    card.querySelector("ul").replaceChildren(...gone().map((one) =>
      Object.assign(document.createElement("li"), { textContent: one.dataset.without })));
    card.querySelector("pre").textContent =
      [acts.command, ...gone().map((one) => `--exclude ${one.dataset.quoted}`)].join(" ");
    turnScene();
  };
}
byId("sorting").hidden = false;
for (const button of buttons) button.onclick = () => {
  for (const one of buttons) one.setAttribute("aria-pressed", one === button);
  const key = (row) => Number(row.dataset[button.dataset.by]) || 0;
  byId("rows").append(...rows.sort((a, b) => key(a) - key(b)));
};

// The target and the cameras in space, seen from far away.
function space(scene, canvas) {
  const g = canvas.getContext("2d");
  let around = -50 * rad, up = 25 * rad, scale = 1;
  turnScene = (x = 0, y = 0, by = 1) => {
    around -= x / 150;
    up = within(-90 * rad, up + y / 150, 90 * rad);
    scale = within(0.2, scale / by, 20);
    canvas.width = canvas.clientWidth * devicePixelRatio || 700;
    canvas.height = 0.6 * canvas.width;
    const [s, c, su, cu] = [around, up].flatMap((one) => [Math.sin(one), Math.cos(one)]);
    g.setTransform(1, 0, 0, 1, canvas.width / 2, canvas.height / 2);
    const k = 0.75 * canvas.height * scale;
    const place = ([x, y, z]) => [k * (y * c - x * s), k * (su * (x * c + y * s) - cu * z)];
    const trace = (points, colour) => {
      g.beginPath();
      points.forEach((one) => g.lineTo(...place(one)));
      g.fillStyle = g.strokeStyle = colour;
      g.stroke();
    };
    g.lineWidth = canvas.width / 700;
    const depth = ([, points]) =>
      points.reduce((sum, [x, y, z]) => sum + cu * (x * c + y * s) + su * z, 0) / points.length;
    for (const [colour, points] of scene.plates.sort((a, b) => depth(a) - depth(b))) {
      trace([...points, points[0]], colour);
      g.fillStyle = `${colour}4d`;
      g.fill();
    }
    for (const point of scene.points.flat()) g.fillRect(...place(point), 2, 2);
    const red = gone().map((row) => row.dataset.photo);
    for (const [photo, points] of scene.cameras)
      trace(points, red.includes(photo) ? "#c84e00" : "#1d2329");
  };
  byId("turning").hidden = false;
  turnable(canvas, turnScene);
  onresize = () => turnScene();
  turnScene();
}
if (acts.scene) space(acts.scene, byId("scene"));

// A photo straightened by the camera's own shader.
function look(view, canvas, photo) {
  const gl = canvas.getContext("webgl2", { preserveDrawingBuffer: true });
  if (!gl) return;
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, view.vertex], [gl.FRAGMENT_SHADER, view.fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return;
  gl.useProgram(program);
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, gl.RGB, gl.UNSIGNED_BYTE, photo);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
  [canvas.width, canvas.height] = view.size;
  gl.viewport(0, 0, canvas.width, canvas.height);
  const kind = byId("kind"), field = byId("field");
  const now = { field: view.start, yaw: 0, pitch: 0, focal: 1 };
  const uniform = (name) => gl.getUniformLocation(program, name);
  const tenths = (x) => Math.round(10 * x) / 10;
  const turn = (x, y, by) => {
    const degrees = canvas.width / canvas.clientWidth / now.focal / rad;
    now.yaw = tenths((now.yaw - x * degrees + 540) % 360 - 180);
    now.pitch = tenths(within(-90, now.pitch + y * degrees, 90));
    const [inner, outer] = view.fields[kind.value];
    now.field = tenths(within(5, now.field * by, outer));
    field.min = Math.min(inner, now.field, view.start);
    field.max = outer;
    field.value = now.field;
    const half = now.field / 2 * rad;
    const offset = { perspective: Math.tan(half), stereographic: 2 * Math.tan(half / 2) };
    now.focal = canvas.width / 2 / (offset[kind.value] ?? half);
    const [sy, cy, sp, cp] =
      [now.yaw * rad, now.pitch * rad].flatMap((one) => [Math.sin(one), Math.cos(one)]);
    gl.uniformMatrix3fv(uniform("turn"), false,
      [cy, 0, -sy, sy * sp, cp, cy * sp, sy * cp, -sp, cy * cp]);
    gl.uniform1f(uniform("focal"), now.focal);
    gl.uniform1i(uniform("kind"), view.kinds.indexOf(kind.value));
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    byId("look-command").textContent = `${view.command} --view ${kind.value} --hfov ${now.field}`
      + ` --rotate=${now.yaw},${now.pitch},0`;
  };
  kind.append(...view.kinds.map((one) => new Option(one)));
  kind.onchange = () => turn(0, 0, 1);
  field.oninput = () => turn(0, 0, field.value / now.field);
  turnable(canvas, turn);
  document.body.classList.add("looking");
  turn(0, 0, 1);
}
if (acts.view) byId("photo").decode().then(() => look(acts.view, byId("look"), byId("photo")));
