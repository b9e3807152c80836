// The viewer of result meshes: WebGL 2, no dependencies. Faces are drawn without an index buffer: four floats a corner,
// x y z and the field, then which edges of the corner's triangle are cell edges and whether the cell is inverted.
(() => {
  "use strict";
  const $ = id => document.getElementById(id);
  const data = JSON.parse($("meshes").textContent);
  if (!data.jobs.length || !window.DecompressionStream || !window.WebGL2RenderingContext) return;
  const box = $("viewer"), canvas = $("view"), gl = canvas.getContext("webgl2", { antialias: true, alpha: true });
  if (!gl || !box.showModal) return;

  // ---- reading -------------------------------------------------------------------------------------------------
  const inflate = async id => {
    const text = atob($(id).textContent), bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  };
  const positions = (bytes, at, n, [low, high]) => {
    const out = new Float32Array(3 * n);
    for (let a = 0; a < 3; a++, at += 2 * n)
      for (let i = 0, v = 0; i < n; i++) {
        const z = bytes[at + i] | bytes[at + n + i] << 8;
        v = (v + (z >> 1 ^ -(z & 1))) & 65535;
        out[3 * i + a] = low[a] + (high[a] - low[a]) * v / data.steps;
      }
    return out;
  };
  const topologies = {}, results = {};
  const topology = async k => {
    if (topologies[k]) return topologies[k];
    const m = data.meshes[k], bytes = await inflate("mesh-" + k), c = m.corners, n = c * m.cells;
    const cells = new Uint32Array(n), planes = m.points < 65536 ? 2 : 4;
    for (let i = 0, next = 0; i < n; i++) {
      let code = 0;
      for (let p = 0; p < planes; p++) code |= bytes[p * n + i] << 8 * p;
      cells[i] = next - code;
      if (!code) next++;
    }
    // The neighbour across each face, or -1 on the boundary; face f lies opposite corner f.
    const neighbour = new Int32Array(n).fill(-1);
    if (c === 4) {
      const open = new Map();
      for (let t = 0; t < n; t += 4) for (let f = 0; f < 4; f++) {
        const v = [0, 1, 2, 3].filter(j => j !== f).map(j => cells[t + j]).sort((a, b) => a - b);
        const key = (v[0] * m.points + v[1]) * m.points + v[2], other = open.get(key);
        if (other === undefined) open.set(key, t + f);
        else { neighbour[t + f] = other >> 2; neighbour[other] = t >> 2; open.delete(key); }
      }
    }
    // Which pairs of a cell's corners are no edges, as bits.
    const at = planes * n, hidden = m.diagonals ? bytes.subarray(at, at + m.cells) : null;
    return topologies[k] = { c, n: m.cells, cells, neighbour, hidden, source: positions(bytes, at + (hidden ? m.cells : 0), m.points, m.box) };
  };
  const result = async j => {
    if (results[j]) return results[j];
    const job = data.jobs[j], m = data.meshes[job.mesh], mesh = await topology(job.mesh), bytes = await inflate("job-" + j);
    let at = 0, image = mesh.source;
    if (job.box) { image = positions(bytes, 0, m.points, job.box); at = 6 * m.points; }
    const fields = job.fields.map((_, i) => bytes.slice(at + i * m.cells, at + (i + 1) * m.cells));
    for (const f of fields) for (let i = 1; i < f.length; i++) f[i] += f[i - 1];
    return results[j] = { job, mesh, image, fields, inverted: bytes.subarray(at + fields.length * m.cells) };
  };

  // ---- drawing -------------------------------------------------------------------------------------------------
  const shader = (type, text) => {
    const s = gl.createShader(type);
    gl.shaderSource(s, "#version 300 es\nprecision highp float;" + text);
    gl.compileShader(s);
    return s;
  };
  const program = gl.createProgram();
  gl.attachShader(program, shader(gl.VERTEX_SHADER, `uniform mat4 m;uniform vec3 eye;layout(location=0)in vec4 p;
layout(location=1)in vec4 e;out vec3 q;out vec3 edge;flat out float v;flat out float bad;
void main(){q=p.xyz;v=p.w;edge=e.xyz;bad=e.w;gl_Position=m*vec4(p.xyz,1.);}`));
  gl.attachShader(program, shader(gl.FRAGMENT_SHADER, `uniform vec4 plane;uniform vec3 eye;uniform vec2 range;
uniform float wire,log_;uniform vec3 map[9];in vec3 q;in vec3 edge;flat in float v;flat in float bad;out vec4 o;
void main(){bool cap=bad>1.5;if(!cap&&dot(plane.xyz,q)>plane.w)discard;
float x=clamp((v-range.x)/(range.y-range.x),0.,1.)*8.;int i=int(min(x,7.));vec3 c=mix(map[i],map[i+1],x-float(i));
if(v<0.)c=vec3(.59);float b=cap?bad-2.:bad;
if(b>.5){c=vec3(.84,.08,.16);if(mod(gl_FragCoord.x+gl_FragCoord.y,10.)<3.)c*=.5;}
vec3 n=normalize(cross(dFdx(q),dFdy(q))),l=normalize(eye-q);float s=cap?1.:.42+.5*abs(dot(n,l));
vec3 w=max(fwidth(edge),1e-6);vec3 d=smoothstep(w*.4,w*1.4,edge);float k=1.-min(min(d.x,d.y),d.z);
o=vec4(mix(c*s,vec3(.05),k*wire),1.);}`));
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return;
  gl.useProgram(program);
  const uniform = name => gl.getUniformLocation(program, name);
  gl.uniform3fv(uniform("map"), data.map.flat().map(x => x / 255));
  const buffer = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  for (const i of [0, 1]) {
    gl.enableVertexAttribArray(i);
    gl.vertexAttribPointer(i, 4, gl.FLOAT, false, 32, 16 * i);
  }
  gl.enable(gl.DEPTH_TEST);

  const state = { job: 0, field: 0, shape: "image", cut: "", at: 50, whole: false, wire: true, turn: 0, tilt: 0, zoom: 1, pan: [0, 0] };
  let shown = null, count = 0, centre = [0, 0, 0], radius = 1, half = [1, 1, 1], points = null;
  const home = () => {
    const [x, y, z] = data.eye;
    Object.assign(state, { turn: Math.atan2(y, x), tilt: Math.atan2(z, Math.hypot(x, y)), zoom: 1, pan: [0, 0] });
  };
  const plane = () => {
    if (!state.cut) return [0, 0, 0, 1];
    const a = "xyz".indexOf(state.cut[1]), s = state.cut[0] === "-" ? -1 : 1, n = [0, 0, 0];
    n[a] = s;
    return [...n, s * (centre[a] + s * half[a] * (state.at / 50 - 1) * 1.001)];
  };

  // Fills the buffer: boundary faces and, where a plane cuts, either its section or the faces of the cells it leaves.
  const build = () => {
    const { mesh, fields, inverted } = shown, { c, n, cells, neighbour, hidden } = mesh, out = [];
    const field = fields[state.field], cut = plane(), on = !!state.cut && c === 4;
    const high = v => cut[0] * points[3 * v] + cut[1] * points[3 * v + 1] + cut[2] * points[3 * v + 2] - cut[3];
    const value = t => field ? (field[t] === 127 ? -1 : field[t] / data.levels) : .35;
    const corner = (p, i, t, e, cap) => out.push(p[0], p[1], p[2], value(t), ...e[i], inverted[t] + cap);
    const E = [[1, 0, 0], [0, 1, 0], [0, 0, 1]], N = [[1, 1, 1], [1, 1, 1], [1, 1, 1]];
    const at = v => points.subarray(3 * v, 3 * v + 3);
    // The coordinate that vanishes on a side which is no edge is raised.
    const pair = [[0, 0, 1, 3], [0, 0, 2, 4], [1, 2, 0, 5], [3, 4, 5, 0]];
    const face = (t, j) => {
      for (let k = 0; k < 3; k++) corner(at(cells[c * t + j[k]]), k, t, hidden ? E.map((e, i) => e.map((x, a) => hidden[t] >> pair[j[(a + 1) % 3]][j[(a + 2) % 3]] & 1 ? 1 : x)) : E, 0);
    };
    const removed = t => {
      let s = 0;
      for (let j = 0; j < 4; j++) s += high(cells[4 * t + j]);
      return s > 0;
    };
    const gone = on && state.whole ? Uint8Array.from({ length: n }, (_, t) => removed(t)) : null;
    const whole = gone ? 2 : 0;
    if (c === 3) {
      for (let t = 0; t < n; t++) face(t, [0, 1, 2]);
    } else for (let t = 0; t < n; t++) {
      if (gone && gone[t]) continue;
      for (let f = 0; f < 4; f++) {
        const other = neighbour[4 * t + f];
        if (other >= 0 && !(gone && gone[other])) continue;
        face(t, [0, 1, 2, 3].filter(j => j !== f));
      }
    }
    if (on && !gone) for (let t = 0; t < n; t++) {
      const under = [], over = [];
      for (let j = 0; j < 4; j++) { const v = cells[4 * t + j], h = high(v); (h > 0 ? over : under).push([v, h]); }
      if (!under.length || !over.length) continue;
      const meet = ([a, h], [b, k]) => { const s = h / (h - k), p = at(a), q = at(b); return [0, 1, 2].map(i => p[i] + s * (q[i] - p[i])); };
      if (under.length !== 2) {
        const one = under.length === 1 ? under[0] : over[0], rest = under.length === 1 ? over : under;
        rest.forEach((r, i) => corner(meet(one, r), i, t, hidden ? N : E, 2));
      } else {
        const q = [meet(under[0], over[0]), meet(under[0], over[1]), meet(under[1], over[1]), meet(under[1], over[0])];
        // The diagonal of a quadrilateral is no cell edge: the coordinate that vanishes on it is raised.
        const F = hidden ? N : [[1, 1, 0], [0, 1, 0], [0, 1, 1]], G = hidden ? N : [[1, 0, 1], [0, 1, 1], [0, 0, 1]];
        [0, 1, 2].forEach(i => corner(q[i], i, t, F, 2));
        [0, 2, 3].forEach((k, i) => corner(q[k], i, t, G, 2));
      }
    }
    count = out.length / 8;
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(out), gl.DYNAMIC_DRAW);
    // Cells that are left whole are not clipped.
    shown.clip = on && !whole;
  };
  const frame = () => {
    const dpr = Math.min(devicePixelRatio || 1, 2), w = canvas.clientWidth, h = canvas.clientHeight;
    if (canvas.width !== Math.round(w * dpr) || canvas.height !== Math.round(h * dpr)) {
      canvas.width = Math.round(w * dpr);
      canvas.height = Math.round(h * dpr);
    }
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const { turn, tilt, zoom, pan } = state, ct = Math.cos(turn), st = Math.sin(turn), ce = Math.cos(tilt), se = Math.sin(tilt);
    const right = [-st, ct, 0], up = [-ct * se, -st * se, ce], back = [ct * ce, st * ce, se];
    const focus = 4, distance = focus * radius, f = focus / 1.1 * zoom, aspect = w / h, near = distance - 1.5 * radius, far = distance + 1.5 * radius;
    const sx = f / Math.max(aspect, 1), sy = f * Math.min(aspect, 1);
    const a = (far + near) / (near - far), b = 2 * far * near / (near - far), m = [];
    const dot = (p, q) => p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    for (let i = 0; i < 3; i++) m.push(sx * right[i] - pan[0] * back[i], sy * up[i] - pan[1] * back[i], a * back[i], -back[i]);
    const cr = dot(centre, right), cu = dot(centre, up), cb = dot(centre, back) + distance;
    m.push(-sx * cr + pan[0] * cb, -sy * cu + pan[1] * cb, -a * cb + b, cb);
    gl.uniformMatrix4fv(uniform("m"), false, m);
    gl.uniform3fv(uniform("eye"), [0, 1, 2].map(i => centre[i] + distance * back[i] + .25 * distance * up[i] - .3 * distance * right[i]));
    gl.uniform4fv(uniform("plane"), shown.clip ? plane() : [0, 0, 0, 1]);
    gl.uniform2fv(uniform("range"), shades());
    gl.uniform1f(uniform("wire"), state.wire ? .4 : 0);
    gl.drawArrays(gl.TRIANGLES, 0, count);
  };
  let pending = false;
  const draw = () => {
    if (pending || !shown) return;
    pending = true;
    requestAnimationFrame(() => { pending = false; frame(); });
  };

  // ---- the field's range ---------------------------------------------------------------------------------------
  // Stored levels run from 0 to 1 over the stored range; the shown range is chosen within it.
  const scale = () => shown.job.fields.length ? data.scales[shown.job.fields[state.field]] : null;
  const place = (s, x) => s.log ? Math.log(x / s.low) / Math.log(s.high / s.low) : (x - s.low) / (s.high - s.low);
  const shades = () => {
    const s = scale();
    if (!s) return [0, 1];
    const low = place(s, +$("low").value), high = place(s, +$("high").value);
    return isFinite(low) && isFinite(high) && low !== high ? [low, high] : [0, 1];
  };
  const digits = x => { const t = (+x).toPrecision(4); return t.includes("e") || !t.includes(".") ? t : t.replace(/\.?0+$/, ""); };
  const legend = fresh => {
    const s = scale();
    $("legend").hidden = !s;
    if (!s) return;
    if (fresh) { $("low").value = digits(s.low); $("high").value = digits(s.high); }
    const low = +$("low").value, high = +$("high").value;
    const ticks = [0, .25, .5, .75, 1].map(x => digits(s.log ? low * (high / low) ** x : low + (high - low) * x));
    if (s.least < Math.min(low, high)) ticks[low < high ? 0 : 4] = "≤ " + ticks[low < high ? 0 : 4];
    if (s.most > Math.max(low, high)) ticks[low < high ? 4 : 0] = "≥ " + ticks[low < high ? 4 : 0];
    $("ticks").replaceChildren(...ticks.map(t => Object.assign(document.createElement("span"), { textContent: t })));
    $("unit").textContent = s.label + (s.log ? ", logarithmic" : "");
  };
  $("bar").style.background = "linear-gradient(90deg," + data.map.map(c => "rgb(" + c + ")").join(",") + ")";

  // ---- choosing ------------------------------------------------------------------------------------------------
  const option = (value, text) => Object.assign(document.createElement("option"), { value, textContent: text });
  const measure = () => {
    points = state.shape === "source" ? shown.mesh.source : shown.image;
    const low = [1 / 0, 1 / 0, 1 / 0], high = [-1 / 0, -1 / 0, -1 / 0];
    for (let i = 0; i < points.length; i++) { const a = i % 3; low[a] = Math.min(low[a], points[i]); high[a] = Math.max(high[a], points[i]); }
    centre = low.map((l, a) => (l + high[a]) / 2);
    half = low.map((l, a) => (high[a] - l) / 2);
    radius = 0;
    for (let i = 0; i < points.length; i += 3) radius = Math.max(radius, Math.hypot(points[i] - centre[0], points[i + 1] - centre[1], points[i + 2] - centre[2]));
    radius = radius || 1;
  };
  const redo = () => { if (shown) { build(); draw(); } };
  const choose = async j => {
    const before = shown && shown.job.fields[state.field];
    shown = await result(j);
    state.job = j;
    $("job").value = j;
    const same = shown.job.fields.indexOf(before);
    state.field = Math.max(0, same);
    $("field").replaceChildren(...shown.job.fields.map((name, i) => option(i, data.scales[name].label)));
    $("field").value = state.field;
    $("shape").parentElement.style.display = shown.job.box ? "" : "none";
    $("cut").disabled = $("at").disabled = $("whole").disabled = shown.mesh.c !== 4;
    const bad = shown.inverted.reduce((a, b) => a + b, 0);
    const solid = shown.mesh.c === 4, kind = solid ? " cells" : " triangles";
    $("facts").textContent = shown.mesh.n + kind + (bad ? ", " + bad + " inverted (striped red)" : solid ? ", none inverted" : "") + (shown.job.facts ? "; " + shown.job.facts : "");
    measure();
    legend(same < 0);
    redo();
  };
  const open = async j => {
    if (!shown) { home(); state.cut = $("cut").value = data.jobs[j].cut; }
    box.showModal();
    await choose(j);
    canvas.focus();
  };
  $("job").replaceChildren(...data.jobs.map((job, i) => option(i, job.name)));
  $("job").onchange = e => choose(+e.target.value);
  $("field").onchange = e => { state.field = +e.target.value; legend(true); redo(); };
  $("shape").onchange = e => { state.shape = e.target.value; measure(); redo(); };
  $("cut").onchange = e => { state.cut = e.target.value; redo(); };
  $("at").oninput = e => { state.at = +e.target.value; redo(); };
  $("whole").onchange = e => { state.whole = e.target.checked; redo(); };
  $("wire").onchange = e => { state.wire = e.target.checked; draw(); };
  $("low").oninput = $("high").oninput = () => { legend(false); draw(); };
  $("reset").onclick = () => { home(); legend(true); draw(); };
  $("close").onclick = () => box.close();
  addEventListener("resize", draw);

  // ---- mouse, fingers, keys ------------------------------------------------------------------------------------
  const fingers = new Map();
  const move = (dx, dy, shift) => {
    const size = Math.min(canvas.clientWidth, canvas.clientHeight);
    if (shift) { state.pan[0] += 2 * dx / canvas.clientWidth; state.pan[1] -= 2 * dy / canvas.clientHeight; }
    else { state.turn -= 4 * dx / size; state.tilt = Math.max(-1.57, Math.min(1.57, state.tilt + 4 * dy / size)); }
    draw();
  };
  const zoom = factor => { state.zoom = Math.max(.2, Math.min(40, state.zoom * factor)); draw(); };
  canvas.onpointerdown = e => { canvas.setPointerCapture(e.pointerId); fingers.set(e.pointerId, e); };
  canvas.onpointerup = canvas.onpointercancel = e => fingers.delete(e.pointerId);
  canvas.onpointermove = e => {
    const last = fingers.get(e.pointerId);
    if (!last) return;
    const other = [...fingers.values()].find(f => f.pointerId !== e.pointerId);
    if (other) {
      const span = p => Math.hypot(p.clientX - other.clientX, p.clientY - other.clientY);
      zoom(span(e) / (span(last) || 1));
      move((e.clientX - last.clientX) / 2, (e.clientY - last.clientY) / 2, true);
    } else move(e.clientX - last.clientX, e.clientY - last.clientY, e.shiftKey || e.buttons > 1);
    fingers.set(e.pointerId, e);
  };
  canvas.oncontextmenu = e => e.preventDefault();
  canvas.addEventListener("wheel", e => { e.preventDefault(); zoom(Math.exp(-e.deltaY / 500)); }, { passive: false });
  canvas.onkeydown = e => {
    const step = { ArrowLeft: [-25, 0], ArrowRight: [25, 0], ArrowUp: [0, -25], ArrowDown: [0, 25] }[e.key];
    const cut = by => { state.at = Math.max(0, Math.min(100, state.at + by)); $("at").value = state.at; redo(); };
    if (step) move(...step, e.shiftKey);
    else if (e.key === "+" || e.key === "=") zoom(1.15);
    else if (e.key === "-") zoom(1 / 1.15);
    else if (e.key === "[") cut(-2);
    else if (e.key === "]") cut(2);
    else if (e.key === "w") $("wire").click();
    else if (e.key === "0") $("reset").click();
    else return;
    e.preventDefault();
  };
  for (const picture of document.querySelectorAll("[data-view]")) {
    const button = picture.querySelector("button"), job = +picture.dataset.view;
    button.hidden = false;
    button.onclick = () => open(job);
    picture.querySelector("img").onclick = () => open(job);
    picture.classList.add("live");
  }
})();
