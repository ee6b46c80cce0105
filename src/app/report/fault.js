// A fault shows on the page, and in an attribute that tests read.
function fail(error) {
  const place = document.getElementById("failure");
  place.textContent = `Part of this page could not be drawn: ${error}`;
  place.hidden = false;
  document.documentElement.dataset.ready = String(error);
}
window.addEventListener("error", (event) => fail(event.message));

/** Calls each of `parts` with the data in the page. */
function drawPage(...parts) {
  try {
    const data = JSON.parse(document.getElementById("page-data").textContent);
    document.documentElement.dataset.ready = "ok";
    for (const draw of parts) draw(data);
  } catch (error) {
    fail(error);
  }
}
