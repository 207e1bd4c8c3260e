// The page of a comparison: the body, the range-Doppler map of each model, and what each differs from the reference by, all at
// the moment that the slider chooses.

const diverging = [[0, "#1f6fd6"], [0.5, "#f4f4f4"], [1, "#d9371f"]];

async function main() {
  const { models, box } = data;
  const [low, high] = data.limits_db;
  const levels = await Promise.all(models.map((model) => unpacked(model.map.levels)));
  const reference = models.length - 1;
  const level = (model, step) => mapRows(models[model].map, levels[model], step).map((row) => row.map((value) => Math.max(value, low)));
  const difference = (model, step) => {
    const others = level(reference, step);
    return level(model, step).map((row, at) => row.map((value, column) => value - others[at][column]));
  };

  const [x, y, z] = figure.ranges;
  const body = await draw("scene-figure", figureTraces({ color: "#4c8fd6" }), {
    aspectmode: "data", domain: { x: [0, 1], y: [0, 1] },
    xaxis: metres("x [m]", x), yaxis: metres("y [m]", y), zaxis: metres("z [m]", z),
    camera: { eye: { x: -0.45, y: -1.65, z: 0.5 }, center: { x: -0.05, y: 0, z: -0.1 } },
  }, 1.9, themeFigure);

  /** One map for each panel: its trace at the first moment, and its rows at any. */
  const panels = [
    ...models.map((model, k) => ({
      id: `scene-map-${k}`, rows: (step) => level(k, step), map: model.map,
      style: { colorscale: "Viridis", zmin: low, zmax: high, colorbar: flatBar(model.map.label) }, unit: unitOf(model.map),
    })),
    ...models.slice(0, reference).map((model, k) => ({
      id: `scene-difference-${k}`, rows: (step) => difference(k, step), map: model.map,
      style: { colorscale: diverging, zmin: -data.difference_db, zmax: data.difference_db, colorbar: flatBar("Difference [dB]") }, unit: "dB",
    })),
  ];
  for (const panel of panels) {
    panel.node = await drawFlat(panel.id, [heat(panel.map, panel.rows(0), {
      ...panel.style, hovertemplate: `%{x:.2f} m/s, %{y:.2f} m<br>%{z:.1f} ${panel.unit}<extra></extra>`,
    })], { xaxis: { text: velocityLabel, range: box[0] }, yaxis: { text: "Range [m]", range: box[1] } });
  }

  async function show(step) {
    await move(body, placesAt(step, -1));
    for (const panel of panels) await restyle(panel.node, [{ trace: 0, z: panel.rows(step) }]);
  }

  await player(body, show).ready;
  document.documentElement.dataset.ready = "true";
}

unpackPlotly().then(main);
