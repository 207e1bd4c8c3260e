// The page of a run: the linked views of body and maps, where there is a body, and the clouds by themselves.

/** The radar beside its cloud, at coordinates named as the axes of the view. */
const radarMark = (type, place) => ({
  type, mode: "markers+text", text: ["radar"], textposition: "top center", ...Object.fromEntries(Object.entries(place).map(([name, value]) => [name, [value]])),
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
  document.documentElement.dataset.ready = "true";
}

unpackPlotly().then(main);
