// The page of a run: the linked views of body and maps, where there is a body, and the clouds by themselves.

/** The radar beside its cloud, at coordinates named as the axes of the view. */
const radarMark = (type, place) => ({
  type, mode: "markers+text", textposition: "top center", ...Object.fromEntries(Object.entries(place).map(([name, value]) => [name, [value]])),
  marker: { size: 6, symbol: "diamond", color: colour("--tx") }, hoverinfo: "skip", showlegend: false,
});

/** Traces of the spatial cloud at these coordinates: in the colours of who returned the points where there are several, or of velocity. */
function spatialTraces(trace, places, size, colourBar) {
  const { source } = data.spatial;
  const velocity = floats(data.spatial.velocity);
  const time = floats(data.spatial.time);
  if (!source || !data.people || data.people.names.length < 3) {
    return [{ ...trace, ...places, customdata: time, showlegend: false, marker: { ...velocityMarkers(velocity, size), ...colourBar } }];
  }
  return data.people.names.map((name, number) => {
    const own = Array.from(source.keys()).filter((index) => (source[index] < 0 ? data.people.names.length - 1 : source[index]) === number);
    const chosen = Object.fromEntries(Object.entries(places).map(([axis, values]) => [axis, own.map((index) => values[index])]));
    return { ...trace, ...chosen, name, customdata: own.map((index) => time[index]), marker: { size, color: data.people.colours[number] } };
  });
}

/** The cloud of an array on one line: x and the coordinate along the line, which are all that it measures. */
async function plan() {
  const points = floats(data.spatial.points);
  const along = data.spatial.measured[1] ? 1 : 2;
  const { ranges, radar_m: place } = data.spatial;
  await drawFlat("scene-spatial", [...spatialTraces({
    type: "scatter", mode: "markers", hovertemplate: "(%{x:.2f}, %{y:.2f}) m<br>%{customdata:.2f} s<extra></extra>",
  }, { x: component(points, 0), y: component(points, along) }, 3, { colorbar: flatBar(velocityLabel) }), radarMark("scatter", { x: place[0], y: place[along] })], {
    xaxis: { range: ranges[0], text: narrow ? "x [m]" : "x [m], by the distance from the line of the array" },
    yaxis: { text: `${"xyz"[along]} [m]`, range: ranges[along], scaleanchor: "x" },
  });
}

// What lies over a map, by its kind: points or a line, in colours that stand out of the map and of the page.
const lining = (color, more) => ({ mode: "lines", line: { color, width: 1.5, ...more } });
const overlays = {
  detection: { mode: "markers", marker: { size: 3, color: "#ff5a4d" } },
  ghost: { mode: "markers+text", textposition: "top right", textfont: { color: "#ff8fd0" }, marker: { size: 11, symbol: "circle-open", color: "#ff8fd0", line: { width: 1.5 } } },
  wall: lining("#9aa6b8", { dash: "dash" }),
  furniture: lining("#d9a24e"),
  reflector: lining("#4ec2d9"),
  person: lining("#2f9e6e", { width: 3 }),
  path: lining("#8f7be0", { width: 1 }),
  radar: { mode: "markers+text", textposition: "top center", marker: { size: 10, symbol: "triangle-up", color: "#d6402b" } },
};

/** One map with what lies over it, or the plan of a room, which has no levels and equal scales. */
function drawMap(number, levels) {
  const map = data.maps[number];
  const traces = levels ? [heat(map, mapRows(map, levels, 0), {
    colorscale: "Viridis", colorbar: flatBar(map.label), hovertemplate: `%{x:.2f}, %{y:.2f}<br>%{z:.1f} ${unitOf(map)}<extra></extra>`,
  })] : [];
  for (const { kind, name, xy } of map.over) {
    const places = floats(xy);
    const [x, y] = [0, 1].map((k) => places.filter((_, index) => index % 2 === k));
    traces.push({ type: "scatter", name, x, y, text: [name], hovertemplate: "%{fullData.name}<extra></extra>", ...overlays[kind] });
  }
  const side = (k) => ({ text: narrow ? map.labels[k].replace(/ \(.*\)/, "") : map.labels[k], range: map.view[k] });
  return drawFlat(`scene-map-${number}`, traces, { xaxis: side(0), yaxis: levels ? side(1) : { ...side(1), scaleanchor: "x" } });
}

/** Draws each map when it comes near the window, or all before they are printed, so that the page opens at once. */
async function drawMaps() {
  const levels = await Promise.all(data.maps.map((map) => map.levels && unpacked(map.levels)));
  const left = new Set(data.maps.keys());
  const drawOnce = (number) => left.delete(number) && drawMap(number, levels[number]);
  const watcher = new IntersectionObserver((places) => {
    for (const { isIntersecting, target } of places) if (isIntersecting) drawOnce(Number(target.id.split("-").pop()));
  }, { rootMargin: "50%" });
  for (const number of left) watcher.observe(document.getElementById(`scene-map-${number}`));
  window.addEventListener("beforeprint", () => [...left].forEach(drawOnce));
}

async function main() {
  if (data.echoes) await drawLinked();
  if (data.rdt.count && !data.echoes) {
    const points = floats(data.rdt.points);
    const [time, range, velocity] = [0, 1, 2].map((k) => component(points, k));
    await draw("scene-rdt", [{
      type: "scatter3d", mode: "markers", x: time, y: range, z: velocity, marker: velocityMarkers(velocity, 1.8),
      hovertemplate: "%{x:.2f} s<br>%{y:.2f} m<br>%{z:.2f} m/s<extra></extra>",
    }], {
      domain, aspectmode: "manual", aspectratio: { x: 1.5, y: 1, z: 1 },
      xaxis: axis("Time [s]"), yaxis: axis("Range [m]"), zaxis: axis(velocityLabel),
      camera: { eye: { x: -1.0, y: -1.75, z: 0.75 }, center: { x: 0, y: 0, z: -0.15 } },
    }, 1.6);
  }
  if (spatial) {
    const [[x, y, z], place] = [data.spatial.ranges, data.spatial.radar_m];
    await draw("scene-spatial", [...spatialTraces({
      type: "scatter3d", mode: "markers", hovertemplate: "(%{x:.2f}, %{y:.2f}, %{z:.2f}) m<br>%{customdata:.2f} s<extra></extra>",
    }, { x: component(spatial.points, 0), y: component(spatial.points, 1), z: component(spatial.points, 2) }, 1.8, {}), radarMark("scatter3d", { x: place[0], y: place[1], z: place[2] })], {
      domain, aspectmode: "data", xaxis: axis("x [m]", x), yaxis: axis("y [m]", y), zaxis: axis("z [m]", z),
      camera: { eye: { x: -1.6, y: -1.3, z: 0.7 }, center: { x: 0, y: 0, z: -0.1 } },
    }, 1.6);
  } else if (data.spatial && data.spatial.count) {
    await plan();
  }
  await drawMaps();
  document.documentElement.dataset.ready = "true";
}

unpackPlotly().then(main);
