"use strict";
const byId = (id) => document.getElementById(id);
const acts = JSON.parse(byId("acts").textContent), rad = Math.PI / 180;
const within = (low, x, high) => Math.max(low, Math.min(high, x));

// A drag turns by so many pixels, the wheel zooms by a factor; keys do both.
function turnable(canvas, turn) {
  let last = null;
  canvas.onpointerdown = (e) => {
    canvas.setPointerCapture(e.pointerId);
    last = e;
  };
  canvas.onpointermove = (e) => {
    if (last?.pointerId !== e.pointerId) return;
    turn(e.clientX - last.clientX, e.clientY - last.clientY, 1);
    last = e;
  };
  canvas.onpointerup = canvas.onpointercancel = () => { last = null; };
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
const rows = [...byId("rows").rows], sorting = byId("sorting");
let drawScene = () => {};
for (const row of rows) {
  const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: true });
  box.setAttribute("aria-label", `Use ${row.dataset.photo}`);
  row.querySelector(".name").prepend(box);
  box.onchange = () => {
    row.classList.toggle("gone", !box.checked);
    const gone = rows.filter((one) => one.classList.contains("gone")), card = byId("without");
    card.hidden = !gone.length;
    card.querySelector("ul").replaceChildren(...gone.map((one) =>
      Object.assign(document.createElement("li"), { textContent: one.dataset.without })));
    card.querySelector("pre").textContent =
      [acts.command, ...gone.map((one) => `--exclude ${one.dataset.quoted}`)].join(" ");
    drawScene();
  };
}
sorting.hidden = false;
for (const button of sorting.querySelectorAll("button")) button.onclick = () => {
  for (const one of sorting.querySelectorAll("button"))
    one.setAttribute("aria-pressed", one === button);
  const key = (row) => Number(row.dataset[button.dataset.by]) || 0;
  byId("rows").append(...rows.sort((a, b) => key(a) - key(b)));
};

// The target and the cameras in space, seen from far away.
function space(scene, canvas) {
  const g = canvas.getContext("2d");
  let around = -50 * rad, up = 25 * rad, scale = 1;
  drawScene = () => {
    canvas.width = canvas.clientWidth * devicePixelRatio || 700;
    canvas.height = 0.6 * canvas.width;
    const [s, c, su, cu] = [around, up].flatMap((one) => [Math.sin(one), Math.cos(one)]);
    const k = 0.75 * canvas.height * scale, middle = [canvas.width / 2, canvas.height / 2];
    const near = ([x, y, z]) => cu * (x * c + y * s) + su * z;
    const place = ([x, y, z]) =>
      [middle[0] + k * (y * c - x * s), middle[1] + k * (su * (x * c + y * s) - cu * z)];
    const trace = (points, colour) => {
      g.beginPath();
      points.forEach((one) => g.lineTo(...place(one)));
      g.fillStyle = g.strokeStyle = colour;
      g.stroke();
    };
    g.lineWidth = canvas.width / 700;
    const depth = ([, points]) => points.reduce((sum, one) => sum + near(one), 0) / points.length;
    for (const [colour, points] of scene.plates.sort((a, b) => depth(a) - depth(b))) {
      trace([...points, points[0]], colour);
      g.globalAlpha = 0.3;
      g.fill();
      g.globalAlpha = 1;
    }
    for (const point of scene.points.flat()) g.fillRect(...place(point), 2, 2);
    const gone = rows.filter((one) => one.classList.contains("gone")).map((one) => one.dataset.photo);
    for (const [photo, points] of scene.cameras)
      trace(points, gone.includes(photo) ? "#c84e00" : "#1d2329");
  };
  byId("turning").hidden = false;
  turnable(canvas, (x, y, by) => {
    around -= x / 150;
    up = within(-90 * rad, up + y / 150, 90 * rad);
    scale = within(0.2, scale / by, 20);
    drawScene();
  });
  onresize = drawScene;
  drawScene();
}
if (acts.scene) space(acts.scene, byId("scene"));

// A photo straightened by the camera's own shader.
function look(view, canvas, photo) {
  const gl = canvas.getContext("webgl2", { preserveDrawingBuffer: true });
  if (!gl) return;
  const program = gl.createProgram(), [width, height] = view.size;
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
  canvas.width = Math.min(width, 960);
  canvas.height = Math.round(canvas.width * height / width);
  gl.viewport(0, 0, canvas.width, canvas.height);
  const kind = byId("kind"), field = byId("field"), now = { field: view.start, yaw: 0, pitch: 0 };
  const put = (how, name, ...values) => gl[`uniform${how}`](gl.getUniformLocation(program, name), ...values);
  const tenths = (x) => Math.round(10 * x) / 10;
  let focal = 0;
  const draw = () => {
    const [inner, outer] = view.fields[kind.value];
    field.min = Math.min(inner, now.field, view.start);
    field.max = outer;
    now.field = field.value = tenths(within(5, now.field, outer));
    now.yaw = tenths((now.yaw + 540) % 360 - 180);
    now.pitch = tenths(within(-90, now.pitch, 90));
    const half = now.field / 2 * rad;
    const offset = { perspective: Math.tan(half), stereographic: 2 * Math.tan(half / 2) };
    focal = canvas.width / 2 / (offset[kind.value] ?? half);
    const [sy, cy, sp, cp] =
      [now.yaw * rad, now.pitch * rad].flatMap((one) => [Math.sin(one), Math.cos(one)]);
    put("Matrix3fv", "turn", false, [cy, 0, -sy, sy * sp, cp, cy * sp, sy * cp, -sp, cy * cp]);
    put("2f", "middle", canvas.width / 2, canvas.height / 2);
    put("2f", "size", width, height);
    put("1f", "focal", focal);
    put("1i", "kind", view.kinds.indexOf(kind.value));
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    byId("look-command").textContent = `${view.command} --view ${kind.value} --hfov ${now.field}`
      + ` --rotate=${now.yaw},${now.pitch},0`;
  };
  kind.append(...view.kinds.map((one) => new Option(one)));
  kind.onchange = draw;
  field.oninput = () => {
    now.field = Number(field.value);
    draw();
  };
  turnable(canvas, (x, y, by) => {
    const degrees = canvas.width / canvas.clientWidth / focal / rad;
    now.yaw -= x * degrees;
    now.pitch += y * degrees;
    now.field *= by;
    draw();
  });
  draw();
  document.body.classList.add("looking");
  for (const id of ["look", "looking"]) byId(id).hidden = false;
}
if (acts.view) byId("photo").decode().then(() => look(acts.view, byId("look"), byId("photo")));
