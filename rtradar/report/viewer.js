"use strict";
// The 3D views of the page: the moving figure and the clouds. Needs Plotly and the JSON in #report-data.
(() => {
  const data = JSON.parse(document.getElementById("report-data").textContent);
  // These buttons and no others: by default Plotly also offers to share the data on its own site.
  const config = {
    displaylogo: false, responsive: true, showSendToCloud: false, plotlyServerURL: "",
    modeBarButtons: [["toImage", "orbitRotation", "pan3d", "zoom3d", "resetCameraDefault3d"]],
  };
  // Visible on white and on black, its middle too.
  const velocityColours = [[0, "#1f6fd6"], [0.5, "#9a9aa2"], [1, "#d9371f"]];

  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  function floats(text) {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    return new Float32Array(bytes.buffer);
  }

  /** Every third number from the k-th on. */
  const component = (triples, k) => Float32Array.from({ length: triples.length / 3 }, (_, i) => triples[3 * i + k]);

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
      legend: { x: 0, y: 1, itemsizing: "constant", bgcolor: "rgba(0,0,0,0)" },
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
  const domain = window.innerWidth < 600 ? { x: [0, 1], y: [0.14, 1] } : { x: [0, 0.92], y: [0, 1] };

  /** Colour bar beside a view; below it where the window is narrow. */
  function bar(title) {
    return window.innerWidth < 600
      ? { title: { text: title, side: "top" }, orientation: "h", thickness: 10, len: 0.9, y: 0, yanchor: "bottom" }
      : { title: { text: title, side: "right" }, thickness: 12, len: 0.75, x: 1, xpad: 4 };
  }

  function velocityMarkers(velocity, size) {
    const largest = velocity.reduce((most, value) => Math.max(most, Math.abs(value)), 1e-3);
    return {
      size, color: velocity, cmin: -largest, cmax: largest, colorscale: velocityColours, colorbar: bar("Velocity [m/s], positive receding"),
    };
  }

  // -- the moving figure ---------------------------------------------------------------------------------------------

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
  const antennas = (places, name, colourName, symbol, size) => ({
    type: "scatter3d", mode: "markers", name, x: places.map((p) => p[0]), y: places.map((p) => p[1]), z: places.map((p) => p[2]),
    marker: { size, symbol, color: colour(colourName), line: { width: 0 } },
    hovertemplate: `${name} %{pointNumber}<br>(%{x:.3f}, %{y:.3f}, %{z:.3f}) m<extra></extra>`,
  });

  const spatial = data.spatial && data.spatial.count > 0 && {
    points: floats(data.spatial.points), velocity: floats(data.spatial.velocity), time: floats(data.spatial.time),
  };

  /** The points of the spatial cloud within one radar frame about a time. */
  function pointsAt(time) {
    const chosen = [];
    spatial.time.forEach((at, index) => { if (Math.abs(at - time) <= figure.window_s / 2) chosen.push(index); });
    return [0, 1, 2].map((k) => chosen.map((index) => spatial.points[3 * index + k]));
  }

  function figureTraces() {
    const { mesh: [x, y, z], bones } = posed(0);
    const paint = figure.power_db
      ? { intensity: each((_, index) => figure.power_db[index]), colorscale: "Viridis", colorbar: bar("Mean echo power [dB re 1 m²]") }
      : { color: "#4c8fd6" };
    const powerText = figure.power_db ? "<br>%{intensity:.1f} dB re 1 m²" : "";
    const traces = [
      {
        type: "mesh3d", name: "body", x, y, z, ...allFaces(), ...paint, opacity: 0.72, flatshading: false, text: each((part) => part),
        hovertemplate: `%{text}${powerText}<extra></extra>`,
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
    if (spatial) {
      const [px, py, pz] = pointsAt(figure.times[0]);
      traces.push({
        type: "scatter3d", mode: "markers", name: "spatial cloud, this frame", x: px, y: py, z: pz,
        marker: { size: 2.2, color: "#e0389a" }, hoverinfo: "skip",
      });
    }
    return traces;
  }

  function themeFigure(node) {
    return Plotly.restyle(node, {
      "line.color": [colour("--bone"), colour("--floor")],
    }, [1, 2]).then(() => Plotly.restyle(node, { "marker.color": [colour("--tx"), colour("--rx")] }, [3, 4]));
  }

  /** Play, pause, slider, speed; `#t=0.4` in the address opens the page at rest at that moment. */
  function player(node) {
    const [button, slider, clock, speed] = ["play", "moment", "clock", "speed"].map((id) => document.getElementById(id));
    const last = figure.times.length - 1;
    let playing = false;
    let inView = true;
    let wanted = 0;
    let drawing = null;
    let now = 0;
    let before = 0;
    slider.max = String(last);

    /**
     * Other coordinates for some traces, and nothing else. Plotly's redraw would also set the camera and its mode again, which
     * ends a turn that is under way and deafens the mouse for half a second; an own no-op hides those two methods of the scene.
     */
    async function move(changes, traces) {
      const scene = node._fullLayout.scene._scene;
      scene.setViewport = scene.updateFx = () => {};
      try {
        await Plotly.restyle(node, changes, traces);
      } finally {
        delete scene.setViewport;
        delete scene.updateFx;
      }
    }

    async function redraw() {
      for (let shown = -1; shown !== wanted;) {
        shown = wanted;
        const { mesh, bones } = posed(shown);
        const sets = [mesh, bones];
        const traces = [0, 1];
        if (spatial) {
          sets.push(pointsAt(figure.times[shown]));
          traces.push(5);
        }
        await move({ x: sets.map((s) => s[0]), y: sets.map((s) => s[1]), z: sets.map((s) => s[2]) }, traces);
        node.dataset.frame = String(shown);
      }
      drawing = null;
    }

    /** Draw a frame; one asked for while another is drawn comes after it, and those between are left out. */
    function show(frame) {
      slider.value = String(frame);
      clock.textContent = `${figure.times[frame].toFixed(2)} / ${figure.times[last].toFixed(2)} s`;
      if (frame !== wanted || node.dataset.frame === undefined) {
        wanted = frame;
        drawing = drawing || redraw();
      }
      return drawing;
    }

    function step(stamp) {
      if (!playing) return;
      if (inView) {
        now += Math.min((stamp - before) / 1000, 0.25) * Number(speed.value);
        if (now > figure.times[last]) now = 0;
        show(nearest(now));
      }
      before = stamp;
      requestAnimationFrame(step);
    }

    const nearest = (time) => Math.min(last, Math.max(0, Math.round(time / figure.times[last] * last)));

    function play(on) {
      playing = on;
      button.textContent = on ? "Pause" : "Play";
      if (on) requestAnimationFrame((stamp) => { before = stamp; step(stamp); });
    }

    button.addEventListener("click", () => play(!playing));
    slider.addEventListener("input", () => {
      play(false);
      now = figure.times[Number(slider.value)];
      show(Number(slider.value));
    });
    new IntersectionObserver((seen) => { inView = seen[seen.length - 1].isIntersecting; }).observe(node);
    const moment = /^#t=(\d+\.?\d*)$/.exec(location.hash);
    if (moment) now = Number(moment[1]);
    const still = moment || window.matchMedia("(prefers-reduced-motion: reduce)").matches;
    return show(nearest(now)).then(() => play(!still));
  }

  // -- all views -----------------------------------------------------------------------------------------------------

  async function main() {
    const [x, y, z] = figure.ranges;
    const node = await draw("scene-figure", figureTraces(), {
      aspectmode: "data", domain,
      xaxis: metres("x [m]", x), yaxis: metres("y [m]", y), zaxis: metres("z [m]", z),
      camera: { eye: { x: -0.45, y: -1.65, z: 0.5 }, center: { x: -0.12, y: 0, z: -0.1 } },
    }, 1.9, themeFigure);
    await player(node);

    if (data.rdt.count) {
      const points = floats(data.rdt.points);
      const [time, range, velocity] = [0, 1, 2].map((k) => component(points, k));
      await draw("scene-rdt", [{
        type: "scatter3d", mode: "markers", x: time, y: range, z: velocity, marker: velocityMarkers(velocity, 1.8),
        hovertemplate: "%{x:.2f} s<br>%{y:.2f} m<br>%{z:.2f} m/s<extra></extra>",
      }], {
        domain, aspectmode: "manual", aspectratio: { x: 1.5, y: 1, z: 1 },
        xaxis: axis("Time [s]"), yaxis: axis("Range [m]"), zaxis: axis("Velocity [m/s]"),
        camera: { eye: { x: -1.0, y: -1.75, z: 0.75 }, center: { x: 0, y: 0, z: -0.15 } },
      }, 1.6);
    }
    if (spatial) {
      await draw("scene-spatial", [{
        type: "scatter3d", mode: "markers", x: component(spatial.points, 0), y: component(spatial.points, 1), z: component(spatial.points, 2),
        marker: velocityMarkers(spatial.velocity, 1.8), customdata: spatial.time,
        hovertemplate: "(%{x:.2f}, %{y:.2f}, %{z:.2f}) m<br>%{customdata:.2f} s<extra></extra>",
      }], {
        domain, aspectmode: "data", xaxis: axis("x [m]"), yaxis: axis("y [m]"), zaxis: axis("z [m]"),
        camera: { eye: { x: -1.6, y: -1.3, z: 0.7 }, center: { x: 0, y: 0, z: -0.1 } },
      }, 1.6);
    }
    document.documentElement.dataset.ready = "true";
  }

  main();
})();
