// Curves and 3D view of the report, from the numbers in the element "data".
"use strict";

const { series, curves, view } = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);
// The buttons are listed since those that the library shows by itself may lead out of the page.
const config = (...modeBarButtons) => ({
  displaylogo: false, responsive: true, modeBarButtons: [modeBarButtons],
});
const FLAT = config("toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d");
const SPATIAL = config("toImage", "zoom3d", "pan3d", "orbitRotation", "tableRotation");

function bytes(text) {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
}
const floats = (text) => new Float32Array(bytes(text));
const integers = (text) => new Int32Array(bytes(text));

// Colours of the page, which follow the reader's light or dark setting.
function look() {
  const style = getComputedStyle(document.documentElement);
  const value = (name) => style.getPropertyValue(name).trim();
  return { text: value("--text"), line: value("--line"), soft: value("--soft"), ground: value("--ground") };
}

// --- curves --------------------------------------------------------------------------------------

function drawCurves(id, traces, title, x, y) {
  const { text, line, soft, ground } = look();
  const upright = id === "energy-over-time";
  const axis = { gridcolor: line, zerolinecolor: line, linecolor: line };
  const overTime = id.endsWith("over-time") ? curves.stages : [];
  const start = (i) => (i ? overTime[i - 1].end : 0);
  Plotly.react(id, traces, {
    title: { text: title, font: { size: 15 } },
    font: { color: text, size: 13 },
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    margin: { l: 65, r: 15, t: 45, b: 50 },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: soft, activecolor: text },
    hovermode: "x unified",
    hoverlabel: { bgcolor: ground, font: { color: text } },
    legend: upright ? { orientation: "v", y: 1 } : { orientation: "h", y: -0.3 },
    xaxis: { ...axis, title: { text: x } },
    yaxis: { ...axis, title: { text: y }, rangemode: "tozero" },
    shapes: overTime.slice(0, -1).map(({ end }) => ({
      type: "line", x0: end, x1: end, yref: "paper", y0: 0, y1: 1,
      line: { color: soft, width: 1, dash: "dot" },
    })),
    annotations: overTime.map(({ name, end }, i) => ({
      x: 0.5 * (start(i) + end), yref: "paper", y: 1, yanchor: "bottom", text: name,
      showarrow: false, font: { color: soft, size: 11 },
    })),
  }, FLAT);
}

function drawForces() {
  if (!curves.tools.length) return;
  const punch = curves.tools[curves.punch];
  const lines = (x) => [
    ...curves.tools.map((tool, i) => ({
      x, y: tool.force, name: tool.name, mode: "lines",
      line: { color: series[i % series.length], width: tool === punch ? 2.5 : 1.5 },
    })),
    ...(punch.peak ? [{
      x, y: punch.peak, name: `${punch.name}, largest step`, mode: "lines",
      line: { color: look().soft, width: 0.8 }, visible: "legendonly",
    }] : []),
  ];
  if (punch.travel.some((travel) => travel !== punch.travel[0])) {
    drawCurves("force-over-travel", lines(punch.travel), "Force over travel",
      `travel of ${punch.name} [mm]`, "mean contact force [N]");
  } else {
    document.getElementById("force-over-travel").remove();
  }
  drawCurves("force-over-time", lines(curves.time), "Force over time", "time [ms]",
    "mean contact force [N]");
}

function drawEnergies() {
  const traces = curves.energies.map(({ name, values }, i) => ({
    x: curves.time, y: values, mode: "lines", name: i === 0 ? "external work" : name,
    line: i === 0 ? { color: look().text, dash: "dash", width: 1.8 } : {
      color: series[(i - 1) % series.length],
      dash: i > series.length ? "dot" : "solid",
      width: 1.8,
    },
  }));
  if (traces.length) drawCurves("energy-over-time", traces, "Energies", "time [ms]", "energy [J]");
}

// --- 3D view -------------------------------------------------------------------------------------

const faces = integers(view.faces);
const faceCount = faces.length / 4;
const CAMERAS = {
  oblique: { eye: { x: 1.1, y: -1.7, z: 1.3 }, up: { x: 0, y: 0, z: 1 }, center: { x: 0, y: 0, z: -0.15 } },
  below: { eye: { x: 1.1, y: 1.7, z: -1.3 }, up: { x: 0, y: 0, z: -1 }, center: { x: 0, y: 0, z: 0.15 } },
  above: { eye: { x: 0, y: 0, z: 2.2 }, up: { x: 0, y: 1, z: 0 }, center: { x: 0, y: 0, z: 0 } },
  side: { eye: { x: 0, y: -2.2, z: 0 }, up: { x: 0, y: 0, z: 1 }, center: { x: 0, y: 0, z: 0 } },
};
let camera = CAMERAS[view.hangs_down ? "below" : "oblique"];

// Two triangles for every face of four nodes, one where the last node is repeated.
const triangles = { i: [], j: [], k: [], face: [] };
for (let f = 0; f < faceCount; f++) {
  const [a, b, c, d] = faces.subarray(4 * f, 4 * f + 4);
  triangles.i.push(a); triangles.j.push(b); triangles.k.push(c); triangles.face.push(f);
  if (c !== d) {
    triangles.i.push(a); triangles.j.push(c); triangles.k.push(d); triangles.face.push(f);
  }
}

const facesOfNode = new Map();
const edges = new Map();  // key: both nodes; value: number of faces
for (let f = 0; f < faceCount; f++) {
  const nodes = [...new Set(faces.subarray(4 * f, 4 * f + 4))];
  nodes.forEach((node, n) => {
    if (!facesOfNode.has(node)) facesOfNode.set(node, []);
    facesOfNode.get(node).push(f);
    const other = nodes[(n + 1) % nodes.length];
    const key = `${Math.min(node, other)} ${Math.max(node, other)}`;
    edges.set(key, (edges.get(key) || 0) + 1);
  });
}
// Plies of a stack: which one a node belongs to, and which are shown.
const plyOfNode = new Int32Array(floats(view.frames[0].positions).length / 3);
view.plies.forEach((ply, n) => plyOfNode.fill(n, ply.nodes[0], ply.nodes[1]));
const plyOfFace = (f) => plyOfNode[faces[4 * f]];
const chosenPly = () => (view.plies.length ? Number(byId("ply").value) : -1);
const isShown = (ply) => chosenPly() < 0 || chosenPly() === ply;

// The points of a frame, each ply lifted off the one below by a part of the stack's size.
function liftedPoints(positions) {
  const points = floats(positions), part = Number(byId("apart").value);
  if (view.plies.length === 0 || part === 0) return points;
  let low = Infinity, high = -Infinity;
  points.forEach((value) => { low = Math.min(low, value); high = Math.max(high, value); });
  return points.map((value, n) => (n % 3 === 2 ? value + part * (high - low) * plyOfNode[(n - 2) / 3] : value));
}

const edgeNodes = (wanted) => [...edges].filter(([, count]) => wanted(count))
  .map(([key]) => key.split(" ").map(Number));
const inner = edgeNodes((count) => count > 1);
const rim = edgeNodes((count) => count === 1);

function lines(points, pairs, width, color) {
  const x = [], y = [], z = [];
  for (const [a, b] of pairs) {
    if (!isShown(plyOfNode[a])) continue;
    for (const n of [a, b]) { x.push(points[3 * n]); y.push(points[3 * n + 1]); z.push(points[3 * n + 2]); }
    x.push(null); y.push(null); z.push(null);
  }
  return {
    type: "scatter3d", mode: "lines", x, y, z, hoverinfo: "skip", showlegend: false,
    line: { color, width },
  };
}

function columns(points) {
  const pick = (axis) => Array.from({ length: points.length / 3 }, (_, n) => points[3 * n + axis]);
  return { x: pick(0), y: pick(1), z: pick(2) };
}

function inWords(field, value) {
  const number = Number(value.toFixed(field.decimals)) === 0 ? 0 : value;  // no minus zero
  const unit = field.unit === "°" ? "°" : ` ${field.unit}`;
  return `${number.toFixed(field.decimals)}${unit}`.trimEnd();
}

// What stands beside a node: its number, and number and value of the elements around it.
function hoverTexts(field, values, count) {
  const say = (value) => inWords(field, value);
  return Array.from({ length: count }, (_, node) => {
    if (field.place === "node") return `node ${node}<br>${field.title}: ${say(values[node])}`;
    const around = (facesOfNode.get(node) || []).map((f) => `element ${f}: ${say(values[f])}`);
    return [`node ${node}, ${field.title}`, ...around].join("<br>");
  });
}

function meshOf(field, points, values) {
  const onFaces = field.place === "face";
  const there = triangles.face.map((f) => isShown(plyOfFace(f)));
  const own = (list) => list.filter((_, t) => there[t]);
  return {
    type: "mesh3d", ...columns(points), i: own(triangles.i), j: own(triangles.j), k: own(triangles.k),
    intensity: onFaces ? own(triangles.face).map((f) => values[f]) : Array.from(values),
    intensitymode: onFaces ? "cell" : "vertex",
    cmin: field.low, cmax: field.high, colorscale: field.colours, flatshading: onFaces,
    lighting: { ambient: 1, diffuse: 0, specular: 0, fresnel: 0 },  // colours carry values
    text: hoverTexts(field, values, points.length / 3), hoverinfo: "x+y+z+text",
    colorbar: {
      title: { text: field.unit ? `${field.title} [${field.unit}]` : field.title, side: "right" },
      len: 0.8, thickness: 16,
    },
    name: "sheet", showlegend: false,
  };
}

// Points x, y, z one after the other, turned by the nine numbers of a rotation; as they are without.
function turned(points, turn) {
  if (!turn) return points;
  const found = new Float32Array(points.length);
  for (let n = 0; n < points.length; n += 3)
    for (let i = 0; i < 3; i += 1)
      found[n + i] = turn[3 * i] * points[n] + turn[3 * i + 1] * points[n + 1] + turn[3 * i + 2] * points[n + 2];
  return found;
}

function toolsAt(frameNumber) {
  return view.tools.filter((tool) => tool.works[frameNumber]).map((tool) => {
    const { x, y, z } = columns(turned(floats(tool.points), tool.turn && tool.turn[frameNumber]));
    const corners = integers(tool.triangles);
    const [dx, dy, dz] = tool.shift[frameNumber];
    const pick = (k) => Array.from({ length: corners.length / 3 }, (_, n) => corners[3 * n + k]);
    return {
      type: "mesh3d", name: tool.name, hoverinfo: "name", opacity: 0.25, showscale: false,
      x: x.map((v) => v + dx), y: y.map((v) => v + dy), z: z.map((v) => v + dz),
      i: pick(0), j: pick(1), k: pick(2), color: series[tool.index % series.length], showlegend: true,
    };
  });
}

function sayExtent(field, values) {
  let low = Infinity, high = -Infinity, sum = 0, count = 0, at = 0;
  values.forEach((value, n) => {
    const ply = field.place === "face" ? plyOfFace(n) : plyOfNode[n];
    if (!Number.isFinite(value) || !isShown(ply)) return;
    low = Math.min(low, value);
    if (value > high) { high = value; at = n; }
    sum += value; count += 1;
  });
  const say = (value) => inWords(field, value);
  byId("extent").textContent = count === 0 ? `${field.title}: no values in this frame` :
    `${field.title}: ${say(low)} to ${say(high)} (${field.place === "face" ? "element" : "node"} ${at}), ` +
    `mean ${say(sum / count)} of ${count.toLocaleString("en")} ${field.place === "face" ? "elements" : "nodes"}`;
}

function drawView() {
  const field = view.fields[Number(byId("field").value)];
  const place = Number(byId("frame").value);
  const frame = view.frames[place];
  const points = liftedPoints(frame.positions);
  const values = floats(field.values[place]);
  const { text, line, soft } = look();
  const traces = [meshOf(field, points, values), lines(points, rim, 4, text)];
  if (byId("edges").checked) traces.push(lines(points, inner, 1, "rgb(34,39,46)"));
  if (byId("tools").checked) traces.push(...toolsAt(frame.number));
  const axis = (title) => ({
    title: { text: title }, gridcolor: line, zerolinecolor: line, color: text,
    backgroundcolor: "rgba(0,0,0,0)", showspikes: false,
  });
  byId("time").textContent = `${frame.time.toPrecision(4)} ms`;
  sayExtent(field, values);
  return Plotly.react("view", traces, {
    font: { color: text, size: 12 },
    paper_bgcolor: "rgba(0,0,0,0)",
    margin: { l: 0, r: 0, t: 0, b: 0 },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: soft, activecolor: text },
    legend: { x: 0, y: 1 },
    uirevision: "view",  // another field keeps the reader's view
    scene: {
      aspectmode: "data", camera, dragmode: "orbit",
      xaxis: axis("x [mm]"), yaxis: axis("y [mm]"), zaxis: axis("z [mm]"),
    },
  }, SPATIAL);
}

function prepareView() {
  view.fields.forEach((field, n) => byId("field").add(new Option(field.title, n)));
  byId("frame").max = view.frames.length - 1;
  byId("frame").value = view.frames.length - 1;
  byId("frame-control").hidden = view.frames.length < 2;
  byId("tools-control").hidden = view.tools.length === 0;
  byId("ply").add(new Option("all", -1));
  view.plies.forEach((ply, n) => byId("ply").add(new Option(ply.name, n)));
  for (const id of ["ply-control", "apart-control"]) byId(id).hidden = view.plies.length === 0;
  byId("apart").addEventListener("input", drawView);
  for (const id of ["field", "edges", "tools", "ply"]) byId(id).addEventListener("change", drawView);
  byId("frame").addEventListener("input", drawView);
  for (const button of document.querySelectorAll("[data-view]")) {
    button.addEventListener("click", () => {
      camera = CAMERAS[button.dataset.view];
      Plotly.relayout("view", { "scene.camera": camera });
    });
  }
}

function drawAll() {
  drawForces();
  drawEnergies();
  return drawView();
}

prepareView();
drawAll().then(() => { document.documentElement.dataset.drawn = "yes"; });
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAll);
