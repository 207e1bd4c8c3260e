// What all pages draw with. Needs the JSON in #report-data and, compressed in #plotly, Plotly.

const data = JSON.parse(document.getElementById("report-data").textContent);
// These buttons and no others: by default Plotly also offers to share the data on its own site.
const config = {
  displaylogo: false, responsive: true, showSendToCloud: false, plotlyServerURL: "",
  modeBarButtons: [["toImage", "orbitRotation", "pan3d", "zoom3d", "resetCameraDefault3d"]],
};
const velocityLabel = "Velocity [m/s] (positive: receding)";
// Visible on white and on black, its middle too.
const velocityColours = [[0, "#1f6fd6"], [0.5, "#9a9aa2"], [1, "#d9371f"]];

/** Unpack Plotly and run it. What it adds to the page is named in the policy, as what is in the page is. */
async function unpackPlotly() {
  const packed = Uint8Array.from(atob(document.getElementById("plotly").textContent), (letter) => letter.charCodeAt(0));
  const script = document.createElement("script");
  script.textContent = await new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  document.head.append(script);
}

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

function floats(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Float32Array(bytes.buffer);
}

const integers = (text) => new Int32Array(floats(text).buffer);

/** Colour of a person or object by index; that of nobody for -1, and for what is out of range. */
const sourceColour = (source) => data.people.colours[source] ?? data.people.colours[data.people.colours.length - 1];

/** Every third number from the k-th on. */
const component = (triples, k) => Float32Array.from({ length: triples.length / 3 }, (_, i) => triples[3 * i + k]);

// In three dimensions only where all three have been measured.
const spatial = data.spatial && data.spatial.count > 0 && data.spatial.measured.every(Boolean) && {
  points: floats(data.spatial.points), velocity: floats(data.spatial.velocity), time: floats(data.spatial.time),
};

/** Parts of the layout that follow the page's light or dark colours. */
function theme() {
  const changes = { "font.color": colour("--ink"), "modebar.color": colour("--faint"), "modebar.activecolor": colour("--accent") };
  for (const axis of ["xaxis", "yaxis", "zaxis"]) {
    changes[`scene.${axis}.gridcolor`] = colour("--line");
    changes[`scene.${axis}.zerolinecolor`] = colour("--line");
    changes[`scene.${axis}.linecolor`] = colour("--faint");
  }
  return changes;
}

/** An eye chosen for a wide view, farther away where the view is narrow. */
function stepBack(eye, node, breadth) {
  const factor = Math.max(1, breadth * node.clientHeight / node.clientWidth);
  return { x: eye.x * factor, y: eye.y * factor, z: eye.z * factor };
}

async function draw(id, traces, scene, breadth, restyleTheme) {
  const node = document.getElementById(id);
  if (!node) return null;
  const layout = {
    margin: { l: 0, r: 0, t: 0, b: 0 },
    paper_bgcolor: "rgba(0,0,0,0)",
    font: { family: getComputedStyle(document.body).fontFamily, size: 12 },
    // Below the view, which gives it the room: in a small one it would meet the labels of the axes.
    legend: { x: 0, y: 0, yanchor: "top", orientation: "h", itemsizing: "constant", bgcolor: "rgba(0,0,0,0)" },
    modebar: { bgcolor: "rgba(0,0,0,0)" },
    scene: { ...scene, camera: { ...scene.camera, eye: stepBack(scene.camera.eye, node, breadth) } },
  };
  await Plotly.newPlot(node, traces, layout, config);
  const follow = async () => {
    await Plotly.relayout(node, theme());
    if (restyleTheme) await restyleTheme(node);
  };
  await follow();
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", follow);
  const canvas = node.querySelector("canvas");
  node.dataset.drawn = String(Boolean(canvas && canvas.width > 0 && canvas.height > 0));
  return node;
}

const axis = (title, range) => ({ title: { text: title }, showbackground: false, showspikes: false, ...(range && { range }) });

const metres = (title, range) => ({ ...axis(title, range), dtick: 1 });
// Room for the colour bar.
const narrow = window.innerWidth < 600;
const domain = narrow ? { x: [0, 1], y: [0.14, 1] } : { x: [0, 0.92], y: [0, 1] };

/** Colour bar beside a view; below it where the window is narrow. */
function bar(title) {
  return narrow
    ? { title: { text: title, side: "top" }, orientation: "h", thickness: 10, len: 0.9, y: 0, yanchor: "bottom" }
    : { title: { text: title, side: "right", font: { size: 11 } }, thickness: 12, len: 0.75, x: 1, xpad: 4 };
}

function velocityMarkers(velocity, size) {
  const largest = velocity.reduce((most, value) => Math.max(most, Math.abs(value)), 1e-3);
  return {
    size, color: velocity, cmin: -largest, cmax: largest, colorscale: velocityColours, colorbar: bar(velocityLabel),
  };
}

/** The same in a flat view, where it lies below the labels of the axis. */
function flatBar(title) {
  return narrow ? { ...bar(title), y: -0.22, yanchor: "top", yref: "paper" } : { ...bar(title), len: 1 };
}

const flatConfig = { ...config, modeBarButtons: [["toImage", "zoom2d", "pan2d", "resetScale2d"]] };

/** A view with two axes that follows the page's colours. */
async function drawFlat(id, traces, layout, restyleTheme) {
  const node = document.getElementById(id);
  if (!node) return null;
  const side = (text) => ({ title: { text, standoff: 6 }, ticks: "outside", ticklen: 4, zeroline: false });
  await Plotly.newPlot(node, traces, {
    // Room for the buttons above, and below for the colour bar of a narrow window.
    margin: { l: 52, r: 8, t: 30, b: narrow ? 92 : 44 }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", showlegend: false,
    font: { family: getComputedStyle(document.body).fontFamily, size: 12 }, modebar: { bgcolor: "rgba(0,0,0,0)" },
    ...layout, xaxis: { ...side(layout.xaxis.text), ...layout.xaxis }, yaxis: { ...side(layout.yaxis.text), ...layout.yaxis },
  }, flatConfig);
  const follow = async () => {
    const changes = { "font.color": colour("--ink"), "modebar.color": colour("--faint"), "modebar.activecolor": colour("--accent") };
    for (const axisName of ["xaxis", "yaxis"]) {
      changes[`${axisName}.gridcolor`] = colour("--line");
      changes[`${axisName}.linecolor`] = changes[`${axisName}.tickcolor`] = colour("--faint");
    }
    await Plotly.relayout(node, changes);
    if (restyleTheme) await restyleTheme(node);
  };
  await follow();
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", follow);
  node.dataset.drawn = "true";
  return node;
}

// -- maps --------------------------------------------------------------------------------------------------------------------

async function unpacked(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Rows [dB] of one map; `levels` holds maps one after the other. */
function mapRows(map, levels, step) {
  const [rows, columns] = map.shape;
  return Array.from({ length: rows }, (_, row) => {
    const at = (step * rows + row) * columns;
    return Float32Array.from(levels.subarray(at, at + columns), (level) => map.low_db + level * map.step_db);
  });
}

const heat = (map, z, more) => ({
  type: "heatmap", z, x0: map.x[0], dx: map.x[1], y0: map.y[0], dy: map.y[1], zmin: map.low_db, zmax: map.high_db, ...more,
});

/** The unit at the end of the label of a map, such as dBsm. */
const unitOf = (map) => /\[(.*)\]$/.exec(map.label)?.[1] ?? "dB";
