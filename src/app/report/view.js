// What the server of `camsplat view` shows: a capture, a model, or a list of reports.
function drawView({ scene, model }) {
  if (scene) drawScene(scene);
  if (model) drawSplats({ model });
  for (const time of document.querySelectorAll("time")) time.textContent = new Date(1000 * time.dataset.seconds).toLocaleString();
}
