// The linked views of a run, on its report and in `rtradar view`: body, room, paths and echoes, the range-Doppler map, the spectrogram and the range-Doppler-time
// cloud, all at the moment that the slider chooses, and in the colours of person, part, power or velocity.

const { echoes, room } = data;
const now = "#e0389a"; // what marks the moment, on every view
const nSteps = figure.times.length;
const nEchoes = echoes.part.length;
const range = floats(echoes.range_m);
const velocity = floats(echoes.velocity_mps);
const power = floats(echoes.power_db); // NaN where occluded
const corners = floats(echoes.corners);
const nCorners = nEchoes ? corners.length / (3 * nSteps * nEchoes) : 0;
const isDirect = (echo) => echoes.bounces[echo] === 1;
const label = (echo) => `${figure.parts[echoes.part[echo]]}, ${isDirect(echo) ? "direct" : `${echoes.paths[echoes.path[echo]]}, ${echoes.bounces[echo]} bounces`}`;
const chosen = (id) => document.getElementById(id).value;

// -- colours -------------------------------------------------------------------------------------------------------------

const hiddenColour = "#8c8c94";
const viridis = ["#440154", "#443983", "#31688e", "#21918c", "#35b779", "#90d743", "#fde725"];
const groups = data.groups; // { names, colours, of_part }; the last is of what belongs to no part
const { people } = data; // the same of people and objects; the last is of nobody
const steps = (tints) => tints.flatMap((tint, k) => [[k / tints.length, tint], [(k + 1) / tints.length, tint]]);
const fromGrey = [[0, hiddenColour], [0.02, hiddenColour], ...viridis.map((tint, k) => [0.021 + 0.979 * k / (viridis.length - 1), tint])];
const modes = {
  person: { colorscale: steps(people.colours), cmin: 0, cmax: people.names.length, title: "" },
  part: { colorscale: steps(groups.colours), cmin: 0, cmax: groups.names.length, title: "" },
  power: { colorscale: fromGrey, cmin: data.power_range_db[0], cmax: data.power_range_db[1], title: data.power_label },
  velocity: { colorscale: data.velocity_colours, cmin: -data.fastest_mps, cmax: data.fastest_mps, title: velocityLabel },
};

const isNamed = (mode) => mode === "part" || mode === "person"; // whose colours a legend names, not a colour bar
const named = (mode, part) => (mode === "part" ? groups : people).of_part[part] + 0.5;

/** A number for the colour of an echo at a step. */
function echoValue(mode, step, echo) {
  if (isNamed(mode)) return named(mode, echoes.part[echo]);
  const level = power[step * nEchoes + echo];
  if (mode === "power") return Number.isNaN(level) ? modes.power.cmin : level;
  return velocity[step * nEchoes + echo];
}

/** The same for every part of the body, by its direct echoes. */
function partValues(mode, step) {
  const values = new Float64Array(nParts).fill(mode === "power" ? modes.power.cmin : 0);
  const strongest = new Float64Array(nParts).fill(-Infinity);
  for (let echo = 0; echo < nEchoes; echo++) {
    const part = echoes.part[echo];
    const level = power[step * nEchoes + echo];
    if (isDirect(echo) && (Number.isNaN(level) ? -1e9 : level) > strongest[part]) {
      strongest[part] = Number.isNaN(level) ? -1e9 : level;
      values[part] = echoValue(mode, step, echo);
    }
  }
  return isNamed(mode) ? figure.parts.map((_, part) => named(mode, part)) : values;
}

const scaleBar = (mode) => ({ ...bar(modes[mode].title), tickfont: { size: 11 } });
const marking = (mode) => ({ colorscale: modes[mode].colorscale, cmin: modes[mode].cmin, cmax: modes[mode].cmax });

// -- what is where -------------------------------------------------------------------------------------------------------

/** Echoes that would show above the noise of the map, direct ones or those over walls. */
function seen(step, direct) {
  const found = [];
  for (let echo = 0; echo < nEchoes; echo++) {
    if (isDirect(echo) === direct && power[step * nEchoes + echo] >= data.map.low_db) found.push(echo);
  }
  return found;
}

/** Lines from the middle of the array over every corner and back, with gaps between, and a colour for each end. */
function pathLines(mode, step, direct) {
  const line = { x: [], y: [], z: [], color: [], text: [] };
  const wanted = chosen("paths");
  if (wanted === "none" || (wanted === "direct" && !direct)) return line;
  const put = (place, value, text) => {
    ["x", "y", "z"].forEach((name, k) => line[name].push(place[k]));
    line.color.push(value);
    line.text.push(text);
  };
  for (const echo of seen(step, direct)) {
    const at = 3 * nCorners * (step * nEchoes + echo);
    const places = Array.from({ length: nCorners }, (_, corner) => corners.slice(at + 3 * corner, at + 3 * corner + 3));
    const real = places.filter((place) => !Number.isNaN(place[0]));
    if (!real.length) continue;
    const value = echoValue(mode, step, echo);
    const text = `${label(echo)}<br>${range[step * nEchoes + echo].toFixed(3)} m, ${velocity[step * nEchoes + echo].toFixed(2)} m/s, ${power[step * nEchoes + echo].toFixed(1)} ${data.power_unit}`;
    // There and back over the same corner is one line.
    const radar = ofRadar(echoes.radar_m, step);
    for (const place of [radar, ...real, ...(real.length > 1 ? [radar] : [])]) put(place, value, text);
    put([null, null, null], value, "");
  }
  return line;
}

function roomTraces() {
  if (!room.walls.length && !room.faces.length) return [];
  const wall = { x: [], y: [], z: [] };
  for (const rectangle of room.walls) {
    for (const place of [...rectangle, rectangle[0], [null, null, null]]) ["x", "y", "z"].forEach((name, k) => wall[name].push(place[k]));
  }
  const traces = [{
    type: "scatter3d", mode: "lines", name: "walls", ...wall, line: { width: 3, color: colour("--faint") }, hoverinfo: "skip",
  }];
  if (room.faces.length) {
    const vertices = floats(room.vertices);
    const face = (k) => room.faces.filter((_, index) => index % 3 === k);
    traces.push({
      type: "mesh3d", name: "furniture", x: component(vertices, 0), y: component(vertices, 1), z: component(vertices, 2),
      i: face(0), j: face(1), k: face(2), color: "#b08d57", opacity: 0.28, flatshading: true, showlegend: true,
      text: room.piece.map((piece) => room.furniture[piece]), hovertemplate: "%{text}<extra></extra>",
    });
  }
  return traces;
}

// -- maps ----------------------------------------------------------------------------------------------------------------

/** Where an echo shows on the velocity axis: beyond the unambiguous velocity at another. */
const folded = (rate) => rate - 2 * data.max_velocity_mps * Math.floor((rate + data.max_velocity_mps) / (2 * data.max_velocity_mps));

function echoMarks(mode, step, direct) {
  const own = seen(step, direct);
  return {
    x: own.map((echo) => folded(velocity[step * nEchoes + echo])), y: own.map((echo) => range[step * nEchoes + echo]),
    color: own.map((echo) => echoValue(mode, step, echo)),
    text: own.map((echo) => `${label(echo)}<br>${velocity[step * nEchoes + echo].toFixed(2)} m/s, ${power[step * nEchoes + echo].toFixed(1)} ${data.power_unit}`),
  };
}

// -- the cloud -----------------------------------------------------------------------------------------------------------

const cloud = data.rdt.count ? {
  points: floats(data.rdt.points), power: floats(data.rdt.power_db), group: data.rdt.group, source: data.rdt.source,
} : null;

function cloudValues(mode, index) {
  if (mode === "part") return cloud.group[index] + 0.5;
  if (mode === "person") return (cloud.source[index] < 0 ? people.names.length - 1 : cloud.source[index]) + 0.5;
  return mode === "power" ? cloud.power[index] : cloud.points[3 * index + 2];
}

/** Of all points, or of those within a window about a time: places and colours. */
function cloudAt(mode, time) {
  const own = [];
  for (let index = 0; index < cloud.points.length / 3; index++) {
    if (time === null || Math.abs(cloud.points[3 * index] - time) <= figure.window_s / 2) own.push(index);
  }
  const [x, y, z] = [0, 1, 2].map((k) => own.map((index) => cloud.points[3 * index + k]));
  return { x, y, z, color: own.map((index) => cloudValues(mode, index)) };
}

/** A frame about the whole cloud at one time. */
function frameAt(time) {
  const [[v0, v1], [r0, r1]] = data.map.box;
  return { x: new Array(5).fill(time), y: [r0, r1, r1, r0, r0], z: [v0, v0, v1, v1, v0] };
}

// -- all together --------------------------------------------------------------------------------------------------------

async function save(title) {
  const views = [...document.querySelectorAll(".linked section")].filter((section) => section.querySelector(".js-plotly-plot"));
  const frame = document.querySelector(".linked").getBoundingClientRect();
  const [scale, top] = [2, 40];
  const canvas = Object.assign(document.createElement("canvas"), { width: scale * frame.width, height: scale * (frame.height + top) });
  const pen = canvas.getContext("2d");
  const family = getComputedStyle(document.body).fontFamily;
  pen.scale(scale, scale);
  const write = (text, size, x, y) => {
    pen.font = `${size}px ${family}`;
    pen.fillStyle = colour("--ink");
    pen.fillText(text, x, y);
  };
  pen.fillStyle = colour("--page");
  pen.fillRect(0, 0, frame.width, frame.height + top);
  write(title, 16, 12, 26);
  if (isNamed(chosen("colour"))) {
    const { names, colours } = chosen("colour") === "part" ? groups : people;
    names.reduceRight((right, name, k) => {
      pen.font = `13px ${family}`;
      const left = right - pen.measureText(name).width;
      write(name, 13, left, 26);
      pen.fillStyle = colours[k];
      pen.fillRect(left - 16, 15, 12, 12);
      return left - 30;
    }, frame.width - 12);
  }
  for (const section of views) {
    const card = section.getBoundingClientRect();
    const [x, y] = [card.x - frame.x, card.y - frame.y + top];
    pen.fillStyle = colour("--card");
    pen.fillRect(x, y, card.width, card.height);
    const [heading, node] = [section.querySelector("h2"), section.querySelector(".js-plotly-plot")];
    const [head, place] = [heading.getBoundingClientRect(), node.getBoundingClientRect()];
    write(heading.textContent, 15, head.x - frame.x, head.y - frame.y + top + 16);
    const scene = node._fullLayout.scene;
    const layout = scene ? { ...node.layout, scene: { ...node.layout.scene, camera: scene._scene.getCamera() } } : node.layout;
    const picture = new Image();
    picture.src = await Plotly.toImage({ data: node.data, layout, config: {} }, { format: "png", width: place.width, height: place.height, scale });
    await picture.decode();
    pen.drawImage(picture, place.x - frame.x, place.y - frame.y + top, place.width, place.height);
  }
  const blob = await new Promise((done) => canvas.toBlob(done, "image/png"));
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: `${data.name}.png` });
  link.click();
  URL.revokeObjectURL(link.href);
}

const nPeople = people.names.length - 1 - data.n_objects;
const saidOfPeople = [...document.querySelectorAll("#people b")].slice(0, nPeople);
const [position, speed] = [floats(people.position_m), floats(people.speed_mps)];

/** Where a person really is, and how fast. */
function truth(step, person) {
  const at = step * nPeople + person;
  return ` at x ${position[3 * at].toFixed(2)}, y ${position[3 * at + 1].toFixed(2)} m, ${speed[at].toFixed(2)} m/s`;
}

/** Draws all views and ties them to the player. */
async function drawLinked() {
  const [mapLevels, spectrogramLevels] = await Promise.all([unpacked(data.map.levels), unpacked(data.spectrogram.levels)]);
  const first = chosen("colour");
  const [x, y, z] = figure.ranges;

  // Body, bones, floor, Tx, Rx; then direct paths, paths over walls, and what does not move.
  const lines = (name, direct, width, opacity) => {
    const { color, ...places } = pathLines(first, 0, direct);
    return {
      type: "scatter3d", mode: "lines", name, ...places, opacity, line: { width, color, ...marking(first) }, showlegend: false,
      hovertemplate: "%{text}<extra></extra>",
    };
  };
  const paint = { intensity: each(() => 0), ...marking(first), showscale: !isNamed(first), colorbar: scaleBar(first) };
  const meshes = movingMeshes(7 + pointsTraces().length + roomTraces().length);
  const traces = [
    // Bones stand out too much beside colours that are to be told apart; the legend brings them back.
    ...figureTraces(paint).map((trace, k) => (k === 1 ? { ...trace, visible: "legendonly" } : trace)), lines("direct paths", true, 3, 0.8), lines("paths over walls", false, 1.5, 0.4),
    ...pointsTraces().map((trace) => ({ ...trace, visible: "legendonly" })), ...roomTraces(),
    ...meshes.map(({ shape, parts, isPerson }) => (isPerson ? { ...shape, intensity: parts.map(() => 0), ...marking(first) } : shape)),
  ];
  const pointsTrace = spatial ? 7 : -1;
  const wallTrace = room.walls.length || room.faces.length ? 7 + pointsTraces().length : -1;
  const body = await draw("scene-figure", traces, {
    aspectmode: "data", domain,
    xaxis: metres("x [m]", x), yaxis: metres("y [m]", y), zaxis: metres("z [m]", z),
    camera: { eye: { x: -0.6, y: -1.75, z: 0.75 }, center: { x: -0.05, y: 0, z: -0.18 } },
  }, 1.9, async (node) => {
    await themeFigure(node);
    if (wallTrace >= 0) await Plotly.restyle(node, { "line.color": colour("--faint") }, [wallTrace]);
  });

  const greys = () => [[0, colour("--card")], [1, colour("--ink")]];
  const marks = (direct) => ({
    type: "scatter", mode: "markers", x: [], y: [], text: [], hovertemplate: "%{text}<extra></extra>",
    marker: { size: direct ? 9 : 7, symbol: direct ? "circle" : "diamond-open", color: [], line: { width: 1, color: direct ? "#ffffff" : undefined }, ...marking(first) },
  });
  const edge = (map, name, length) => [map[name][0] - map[name][1] / 2, map[name][0] + map[name][1] * (length - 0.5)];
  const map = await drawFlat("scene-map", [
    heat(data.map, mapRows(data.map, mapLevels, 0), {
      colorscale: greys(), colorbar: flatBar(data.map.label), hovertemplate: `%{x:.2f} m/s, %{y:.2f} m<br>%{z:.1f} ${unitOf(data.map)}<extra></extra>`,
    }),
    marks(true), marks(false),
  ], {
    xaxis: { text: velocityLabel, range: data.map.box[0] },
    yaxis: { text: "Range [m]", range: data.map.box[1] },
  }, (node) => Plotly.restyle(node, { colorscale: [greys()] }, [0]));

  const cursor = (time) => ({ type: "line", x0: time, x1: time, y0: 0, y1: 1, yref: "paper", line: { color: now, width: 2 } });
  const spectrogram = await drawFlat("scene-spectrogram", [heat(data.spectrogram, mapRows(data.spectrogram, spectrogramLevels, 0), {
    colorscale: "Viridis", colorbar: flatBar(data.spectrogram.label),
    hovertemplate: `%{x:.2f} s, %{y:.2f} m/s<br>%{z:.1f} ${unitOf(data.spectrogram)}<extra></extra>`,
  })], {
    xaxis: { text: "Time [s]", range: edge(data.spectrogram, "x", data.spectrogram.shape[1]) },
    yaxis: { text: narrow ? "Velocity [m/s]" : velocityLabel, range: data.map.box[0] },
    shapes: [cursor(figure.times[0])],
  });

  let rdt = null;
  if (cloud) {
    const dots = (name, time, size, opacity) => {
      const { color, ...places } = cloudAt(first, time);
      return {
        type: "scatter3d", mode: "markers", name, ...places, showlegend: false, marker: { size, opacity, color, ...marking(first), line: { width: 0 } },
        hovertemplate: "%{x:.2f} s<br>%{y:.2f} m<br>%{z:.2f} m/s<extra></extra>",
      };
    };
    rdt = await draw("scene-rdt", [
      dots("all", null, 1.6, 0.35), dots("this window", figure.times[0], 4, 1),
      { type: "scatter3d", mode: "lines", name: "now", ...frameAt(figure.times[0]), showlegend: false, hoverinfo: "skip", line: { width: 3, color: now } },
    ], {
      domain: { x: [0, 1], y: [0, 1] }, aspectmode: "manual", aspectratio: { x: 1.6, y: 1, z: 0.9 },
      xaxis: axis("Time [s]"), yaxis: axis("Range [m]", data.map.box[1]), zaxis: axis("Velocity [m/s]", data.map.box[0]),
      camera: { eye: { x: -1.0, y: -1.9, z: 0.8 }, center: { x: 0, y: 0, z: -0.2 } },
    }, 1.5);
  }

  /** Everything at one step. */
  async function show(step) {
    const mode = chosen("colour");
    const time = figure.times[step];
    const recoloured = document.documentElement.dataset.colour !== mode;
    const { colorscale, cmin, cmax, title } = modes[mode];
    const scale = recoloured ? { colorscale, cmin, cmax, showscale: !isNamed(mode), "colorbar.title.text": title } : {};
    const lineScale = recoloured ? { "line.colorscale": colorscale, "line.cmin": cmin, "line.cmax": cmax } : {};
    const markScale = recoloured ? { "marker.colorscale": colorscale, "marker.cmin": cmin, "marker.cmax": cmax } : {};

    const [values, levels, rates] = [mode, "power", "velocity"].map((which) => partValues(which, step));
    const said = figure.parts.map((part, index) => [
      part, levels[index] > modes.power.cmin ? `${levels[index].toFixed(1)} ${data.power_unit}` : "occluded", `${rates[index].toFixed(2)} m/s`,
    ].join("<br>"));
    const [figurePart, ...others] = placesAt(step, pointsTrace);
    await move(body, [
      { ...figurePart, ...scale, intensity: each((_, part) => values[part]), text: each((_, part) => said[part]) },
      ...others,
      ...meshes.map(({ trace, parts, isPerson, places }) => ({
        trace, ...places(step), ...(isPerson ? { ...scale, showscale: false, intensity: parts.map((part) => values[part]) } : {}),
      })),
      ...[true, false].map((direct) => {
        const { color, ...places } = pathLines(mode, step, direct);
        return { trace: direct ? 5 : 6, ...places, ...lineScale, "line.color": color };
      }),
    ]);
    await restyle(map, [
      { trace: 0, z: mapRows(data.map, mapLevels, step) },
      ...[true, false].map((direct) => {
        const { color, ...places } = echoMarks(mode, step, direct);
        return { trace: direct ? 1 : 2, ...places, ...markScale, "marker.color": color };
      }),
    ]);
    if (spectrogram) await Plotly.relayout(spectrogram, { "shapes[0].x0": time, "shapes[0].x1": time });
    if (rdt) {
      const { color, ...places } = cloudAt(mode, time);
      await move(rdt, [
        ...(recoloured ? [{ trace: 0, ...markScale, "marker.color": cloudAt(mode, null).color }] : []),
        { trace: 1, ...places, ...markScale, "marker.color": color }, { trace: 2, ...frameAt(time) },
      ]);
    }
    document.getElementById("groups").hidden = mode !== "part";
    saidOfPeople.forEach((node, person) => { node.textContent = truth(step, person); });
    document.documentElement.dataset.colour = mode;
  }

  const play = player(body, show);
  await play.ready;
  document.getElementById("colour").addEventListener("change", play.refresh);
  document.getElementById("paths").addEventListener("change", play.refresh);
  document.getElementById("save").addEventListener("click", () => save(
    `${document.querySelector("h1").textContent}, ${document.querySelector(".sub").textContent}: ${document.getElementById("clock").textContent}`,
  ));
  if (spectrogram) spectrogram.on("plotly_click", (event) => play.goTo(event.points[0].x));
}
