// The plots of a training run.

function drawTraining({ curve, evaluations, gains }) {
  const iterations = curve.map((point) => point.iteration);
  const column = (name) => curve.map((point) => point[name]);

  const loss = column("loss");
  lineChart("chart-loss", iterations, [line("loss", loss, 1)], { y: "loss", log: loss.every((v) => v === null || v > 0) });
  const tested = evaluations.map((evaluation) => evaluation.iteration);
  const quality = evaluations.map((evaluation) => evaluation.quality.psnr);
  lineChart("chart-psnr", iterations, [line("training", column("psnr"), 1), dots("test", tested, quality, 2)], { y: "PSNR (dB)" });

  // Counts in the unit that keeps the axis short.
  const counted = (id, name, what) => {
    const values = column(name), most = Math.max(0, ...values);
    const [unit, word] = most >= 2e6 ? [1e6, "millions"] : most >= 2e3 ? [1e3, "thousands"] : [1, ""];
    const scaled = values.map((v) => (v === null ? null : v / unit));
    lineChart(id, iterations, [line(word || what, scaled, 3)], { y: word ? `${what} (${word})` : what });
  };
  counted("chart-splats", "splats", "splats");
  counted("chart-instances", "instances", "instances");
  if (gains.length > 0) {
    const channel = (name, c, colour) => line(name, gains.map((gain) => gain[c]), colour);
    lineChart("chart-gains", gains.map((_, i) => i + 1), [channel("red", 0, 2), channel("green", 1, 3), channel("blue", 2, 1)],
      { y: "gain of grey", over: "photo" });
  }
}
