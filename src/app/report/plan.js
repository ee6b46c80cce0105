// The plots of a plan or a selection.

function drawCharts(plan) {
  const { history, checkpoints, histograms } = plan;

  const terms = [line("total", history.loss, 1)];
  for (const [name, y, colour] of [["image", history.image, 2], ["regulariser", history.reg, 3], ["region", history.bound, 4]]) {
    if (y.some((v) => v)) terms.push(line(name, y, colour, "fine"));
  }
  // Expected quality may go below zero, where a logarithm has nothing to show.
  const log = history.loss.every((v) => v === null || v > 0);
  lineChart("chart-loss", history.iteration, terms.reverse(), { y: "loss", log });
  // Expected quality knows no scale, and one that is held has nothing to show.
  if (new Set(history.scale).size === 1) {
    document.getElementById("chart-scale").style.display = "none";
  } else {
    lineChart("chart-scale", history.iteration, [line("scale s", history.scale, 1)], { y: "scale s" });
  }

  const percent = (values) => values.map((v) => (v === null ? null : 100 * v));
  lineChart("chart-coverage", checkpoints.iteration, [
    line("reachable", percent(checkpoints.reachable), 4, "dashed"),
    line("≥ 3 views", percent(checkpoints.coverage_3), 2),
    line("≥ 1 view", percent(checkpoints.coverage_1), 1),
  ], { y: "points (%)", top: 100 });
  lineChart("chart-gap", checkpoints.iteration, [line("mean gap", checkpoints.gap, 1)], { y: "gap (degrees)" });
  const byScore = [
    line("low scores", checkpoints.voronoi_low, 2),
    line("high scores", checkpoints.voronoi_high, 1),
  ];
  const voronoi = byScore.every((s) => s.y.some((v) => v !== null)) ? byScore : [line("all points", checkpoints.voronoi, 1)];
  lineChart("chart-voronoi", checkpoints.iteration, voronoi, { y: "area (steradians)" });

  barChart("chart-views", histograms.views, { x: "views that see a point", unit: "" });
  barChart("chart-gaps", histograms.gap, { x: "gap (degrees)", unit: "°" });
  const note = (id, parts) => {
    const missing = parts.filter(([count]) => count > 0).map(([count, what]) => `${count} ${what}`);
    if (missing.length > 0) document.querySelector(`#${id} .note`).textContent = `without ${missing.join(" and ")}`;
  };
  const unreachable = [histograms.unreachable, "out of reach"];
  note("chart-views", [unreachable]);
  note("chart-gaps", [[histograms.unseen, "unseen"], unreachable]);

  // Open until here, so that plots have a width.
  document.querySelector(".fold").open = false;
}
