// The moving figure: a body of ellipsoids before the antennas, and the player that moves it.

const figure = data.figure;
const sphere = floats(figure.vertices);
const poses = floats(figure.poses);
const nParts = figure.parts.length;
const nVertices = sphere.length / 3;

/** Corners of all ellipsoids, and the ends of all bones with gaps between them, at one pose. */
function posed(frame) {
  const mesh = [0, 1, 2].map(() => new Float32Array(nParts * nVertices));
  const bones = [0, 1, 2].map(() => new Array(3 * nParts).fill(null));
  for (let part = 0; part < nParts; part++) {
    const at = 12 * (frame * nParts + part);
    for (let k = 0; k < 3; k++) {
      const [centre, a, b, c] = [poses[at + k], poses[at + 3 + k], poses[at + 6 + k], poses[at + 9 + k]];
      for (let v = 0; v < nVertices; v++) {
        mesh[k][part * nVertices + v] = centre + sphere[3 * v] * a + sphere[3 * v + 1] * b + sphere[3 * v + 2] * c;
      }
      bones[k][3 * part] = centre - c;
      bones[k][3 * part + 1] = centre + c;
    }
  }
  return { mesh, bones };
}

function allFaces() {
  const [i, j, k] = [[], [], []];
  for (let part = 0; part < nParts; part++) {
    if (figure.drawn && !figure.drawn[part]) continue; // a mesh is drawn in its place
    for (let face = 0; face < figure.faces.length; face += 3) {
      i.push(figure.faces[face] + part * nVertices);
      j.push(figure.faces[face + 1] + part * nVertices);
      k.push(figure.faces[face + 2] + part * nVertices);
    }
  }
  return { i, j, k };
}

function floorLines() {
  const [x, y, z] = [[], [], []];
  const [[x0, x1], [y0, y1]] = figure.ranges;
  for (let at = x0; at <= x1 + 1e-9; at += 0.5) { x.push(at, at, null); y.push(y0, y1, null); z.push(0, 0, null); }
  for (let at = y0; at <= y1 + 1e-9; at += 0.5) { x.push(x0, x1, null); y.push(at, at, null); z.push(0, 0, null); }
  return { x, y, z };
}

const each = (name) => figure.parts.flatMap((part, index) => new Array(nVertices).fill(name(part, index)));
/** What a radar has at a frame: one of a list for each, or the only one of a radar at rest. */
const ofRadar = (list, frame) => list[Math.min(frame, list.length - 1)];
const coordinates = (places) => ({ x: places.map((p) => p[0]), y: places.map((p) => p[1]), z: places.map((p) => p[2]) });
const antennas = (places, name, colourName, symbol, size) => ({
  type: "scatter3d", mode: "markers", name, ...coordinates(ofRadar(places, 0)),
  marker: { size, symbol, color: colour(colourName), line: { width: 0 } },
  hovertemplate: `${name} %{pointNumber}<br>(%{x:.3f}, %{y:.3f}, %{z:.3f}) m<extra></extra>`,
});

/** The points of the spatial cloud within one radar frame about a time. */
function pointsAt(time) {
  const chosen = [];
  spatial.time.forEach((at, index) => { if (Math.abs(at - time) <= figure.window_s / 2) chosen.push(index); });
  return [0, 1, 2].map((k) => chosen.map((index) => spatial.points[3 * index + k]));
}

/** Colours of these points: of who returned them, where there are several who may have. */
function pointColours(time) {
  if (!data.spatial.source || !data.people || data.people.names.length < 3) return "#e0389a";
  const chosen = data.spatial.source.filter((_, index) => Math.abs(spatial.time[index] - time) <= figure.window_s / 2);
  return chosen.map(sourceColour);
}

/** Body, bones, floor, Tx and Rx: traces 0 to 4 of a 3D view. `paint` colours the body. */
function figureTraces(paint) {
  const { mesh: [x, y, z], bones } = posed(0);
  return [
    {
      type: "mesh3d", name: "body", x, y, z, ...allFaces(), ...paint, opacity: 0.72, flatshading: false, text: each((part) => part),
      hovertemplate: "%{text}<extra></extra>",
      lighting: { ambient: 0.62, diffuse: 0.6, specular: 0.15, roughness: 0.6, fresnel: 0.1 }, lightposition: { x: -20, y: -20, z: 40 },
    },
    {
      type: "scatter3d", mode: "lines", name: "bones", x: bones[0], y: bones[1], z: bones[2], showlegend: true,
      line: { width: 5, color: colour("--bone") }, hoverinfo: "skip",
    },
    { type: "scatter3d", mode: "lines", ...floorLines(), line: { width: 1, color: colour("--floor") }, hoverinfo: "skip", showlegend: false },
    antennas(figure.tx, "Tx", "--tx", "square", 4),
    antennas(figure.rx, "Rx", "--rx", "circle", 2),
  ];
}

/** The points of the spatial cloud that belong to the first frame, where there is such a cloud. */
function pointsTraces() {
  if (!spatial) return [];
  const [x, y, z] = pointsAt(figure.times[0]);
  return [{
    type: "scatter3d", mode: "markers", name: "spatial cloud", x, y, z, marker: { size: 2.2, color: pointColours(figure.times[0]) }, hoverinfo: "skip",
  }];
}

function themeFigure(node) {
  return Plotly.restyle(node, {
    "line.color": [colour("--bone"), colour("--floor")],
  }, [1, 2]).then(() => Plotly.restyle(node, { "marker.color": [colour("--tx"), colour("--rx")] }, [3, 4]));
}

// -- meshes that move ------------------------------------------------------------------------------------------------------

/** Meshes of people, which take their colours from their parts, and of objects: each a trace after `first`, and its places at a step. */
function movingMeshes(first) {
  if (!data.meshes || !data.meshes.source.length) return [];
  const { meshes, people } = data;
  const [faces, owner, part, vertex, row] = ["mesh_faces", "mesh_of_vertex", "mesh_part", "blend_vertex", "blend_row"].map((name) => integers(meshes[name]));
  const [weight, rows] = [floats(meshes.blend_weight), floats(meshes.mesh_rows)];
  const nRows = rows.length / (3 * figure.times.length);
  return meshes.source.map((source, number) => {
    const begin = owner.indexOf(number);
    const count = owner.lastIndexOf(number) + 1 - begin;
    const parts = Array.from(part.slice(begin, begin + count));
    const own = (k) => Array.from({ length: faces.length / 3 }, (_, face) => faces[3 * face + k] - begin);
    const mine = Array.from({ length: faces.length / 3 }, (_, face) => owner[faces[3 * face]] === number);
    const [i, j, k] = [0, 1, 2].map((corner) => own(corner).filter((_, face) => mine[face]));
    const entries = Array.from(vertex.keys()).filter((entry) => owner[vertex[entry]] === number);
    const places = (step) => {
      const out = [0, 1, 2].map(() => new Float32Array(count));
      for (const entry of entries) {
        const at = 3 * (step * nRows + row[entry]);
        for (let axis = 0; axis < 3; axis++) out[axis][vertex[entry] - begin] += weight[entry] * rows[at + axis];
      }
      return { x: out[0], y: out[1], z: out[2] };
    };
    return {
      trace: first + number, parts, isPerson: parts[0] >= 0, places,
      shape: {
        type: "mesh3d", name: people.names[source], ...places(0), i, j, k, showlegend: parts[0] < 0, flatshading: parts[0] < 0,
        color: sourceColour(source), opacity: 0.85, hovertemplate: "%{fullData.name}<extra></extra>",
        lighting: { ambient: 0.62, diffuse: 0.6, specular: 0.15, roughness: 0.6, fresnel: 0.1 }, lightposition: { x: -20, y: -20, z: 40 },
      },
    };
  });
}

/** For `move`: the body, its bones and, where there is a spatial cloud, its points of this frame, which are `pointsTrace`. */
function placesAt(frame, pointsTrace) {
  const { mesh, bones } = posed(frame);
  const sets = [[0, mesh], [1, bones]].map(([trace, [x, y, z]]) => ({ trace, x, y, z }));
  if (figure.tx.length > 1) {
    for (const [trace, places] of [[3, figure.tx], [4, figure.rx]]) sets.push({ trace, ...coordinates(ofRadar(places, frame)) });
  }
  if (!spatial) return sets;
  const [x, y, z] = pointsAt(figure.times[frame]);
  return [...sets, { trace: pointsTrace, x, y, z, "marker.color": pointColours(figure.times[frame]) }];
}

/** Other values of some attributes, each set for its `trace`, drawn once. */
function restyle(node, sets) {
  const names = new Set(sets.flatMap((set) => Object.keys(set)));
  names.delete("trace");
  // What a set does not name is undefined, which Plotly leaves as it is.
  const changes = Object.fromEntries([...names].map((name) => [name, sets.map((set) => set[name])]));
  return Plotly.restyle(node, changes, sets.map((set) => set.trace));
}

/**
 * The same in a 3D view, and nothing else. Plotly's redraw would also set the camera and its mode again, which ends a turn that
 * is under way and deafens the mouse for half a second; an own no-op hides those two methods of the scene.
 */
async function move(node, sets) {
  const scene = node._fullLayout.scene._scene;
  scene.setViewport = scene.updateFx = () => {};
  try {
    await restyle(node, sets);
  } finally {
    delete scene.setViewport;
    delete scene.updateFx;
  }
}

/**
 * Play, pause, slider, speed; `#t=0.4` in the address opens the page at rest at that moment. `paint` draws a frame. Gives `ready`,
 * a promise, `goTo` a time, and `refresh`, which paints the frame again.
 */
function player(node, paint) {
  const [button, slider, clock, speed] = ["play", "moment", "clock", "speed"].map((id) => document.getElementById(id));
  const last = figure.times.length - 1;
  const [start, end] = [figure.times[0], figure.times[last]];
  let playing = false;
  let inView = true;
  let [wanted, shown] = [0, -1];
  let drawing = null;
  let now = start;
  let before = 0;
  slider.max = String(last);

  async function redraw() {
    while (shown !== wanted) {
      shown = wanted;
      await paint(shown);
      node.dataset.frame = String(shown);
    }
    drawing = null;
  }

  /** Draw a frame; one asked for while another is drawn comes after it, and those between are left out. */
  function show(frame) {
    slider.value = String(frame);
    clock.textContent = `${figure.times[frame].toFixed(2)} / ${end.toFixed(2)} s`;
    wanted = frame;
    drawing = drawing || (shown === wanted ? null : redraw());
    return drawing || Promise.resolve();
  }

  function step(stamp) {
    if (!playing) return;
    if (inView) {
      now += Math.min((stamp - before) / 1000, 0.25) * Number(speed.value);
      if (now > end) now = start;
      show(nearest(now));
    }
    before = stamp;
    requestAnimationFrame(step);
  }

  const nearest = (time) => Math.min(last, Math.max(0, Math.round((time - start) / (end - start || 1) * last)));

  function play(on) {
    if (on && !playing) requestAnimationFrame((stamp) => { before = stamp; step(stamp); });
    playing = on;
    button.textContent = on ? "Pause" : "Play";
  }

  function goTo(time) {
    play(false);
    now = time;
    return show(nearest(time));
  }

  function refresh() {
    shown = -1;
    return show(wanted);
  }

  button.addEventListener("click", () => play(!playing));
  slider.addEventListener("input", () => goTo(figure.times[Number(slider.value)]));
  new IntersectionObserver((seen) => { inView = seen[seen.length - 1].isIntersecting; }).observe(node);
  const moment = /^#t=(\d+\.?\d*)$/.exec(location.hash);
  if (moment) now = Number(moment[1]);
  const still = moment || window.matchMedia("(prefers-reduced-motion: reduce)").matches;
  return { ready: show(nearest(now)).then(() => play(!still)), goTo, refresh };
}
