"use strict";
// Asks for the board every 1.5 seconds; what is shown stays where there is no answer.
const BETWEEN = 1500, PATIENCE = 8000;
const ANSWERS = { yes: "Enough", nearly: "Nearly enough", "not yet": "Not yet enough" };
const KINDS = {
  object: "Planned as an object, seen from around it. If it is a room, start camsplat watch again with --preset room.",
  room: "Planned as a room, seen from inside. If it is an object, start camsplat watch again with --preset object.",
};
let version = -1;

const element = (id) => document.getElementById(id);
const made = (tag, properties, ...children) => {
  const node = Object.assign(document.createElement(tag), properties);
  node.append(...children);
  return node;
};
const say = (id, text) => {
  element(id).textContent = text;
  element(id).hidden = !text;
};

function place(item, number) {
  const shown = (source, label) =>
    made("figure", {}, made("img", { src: source, alt: label }), made("figcaption", { textContent: label }));
  return made("li", {},
    made("p", { className: "way" }, made("span", { className: "number", textContent: number }), item.words),
    made("p", { className: "from", textContent: `from ${item.from}${item.new ? "; most of this is new: grey is in no photo nearby" : ""}` }),
    made("div", { className: "pair" }, shown(item.picture, "what the photo should show"), shown(item.start, "start here")));
}

// Photos of one flaw on a line, and lines beyond a few folded, so that many do not hide what to do next.
function flawed(flaws) {
  const FEW = 3, LINES = 5;
  const names = new Map();
  for (const { name, why } of flaws) names.set(why, [...(names.get(why) || []), name]);
  const lines = [...names].map(([why, all]) => {
    const rest = all.length > FEW ? ` and ${all.length - FEW} more` : "";
    return made("li", {}, made("b", { textContent: all.slice(0, FEW).join(", ") + rest }), ` ${why}`);
  });
  if (lines.length <= LINES) return lines;
  const folded = lines.splice(LINES - 1);
  const more = made("details", {}, made("summary", { textContent: `${folded.length} more` }), made("ul", {}, ...folded));
  return [...lines, made("li", {}, more)];
}

function draw(board) {
  document.title = `${board.title} – camsplat watch`;
  const advice = board.advice;
  element("top").className = advice ? advice.enough.replace(" ", "-") : "";
  say("answer", advice ? ANSWERS[advice.enough] || advice.enough : "Take photos");
  say("because", advice ? `${advice.gain} ${advice.hidden}` : "");
  say("count", board.photos ? `${board.photos} photo${board.photos === 1 ? "" : "s"}, ${board.posed} placed` : "No photos yet");
  say("stage", board.stage);
  say("fault", board.fault || "");
  element("flaws").hidden = board.flaws.length === 0;
  element("flaws").replaceChildren(...flawed(board.flaws));
  element("next").hidden = element("above").hidden = !advice;
  say("kind", (advice && KINDS[advice.kind]) || "");
  if (!advice) return;
  // Of the photos before, until the next advice is there.
  const old = !board.current;
  element("next").classList.toggle("old", old);
  element("above").classList.toggle("old", old);
  say("where", old ? "Before the last photos: where to stand next" : "Where to stand next, the nearest to your last photo first");
  element("places").replaceChildren(...advice.next.map((item, i) => place(item, i + 1)));
  // Made by camsplat, with every name in it escaped.
  element("map").innerHTML = advice.map;
  element("parts").hidden = advice.weak.length === 0;
  element("weak").replaceChildren(...advice.weak.map((line) => made("li", { textContent: line })));
  element("notes").replaceChildren(...advice.notes.map((line) => made("li", { textContent: line })));
  const comma = advice.unit.indexOf(", ");
  const said = comma > 0 ? `A${advice.unit.slice(1, comma)} is ${advice.unit.slice(comma + 2)}. ` : "";
  say("unit", `${said}Turn from where the photo to start from looks; aim from level. What you cannot reach leave out, or go as near as you can.`);
}

async function ask() {
  let lost = true;
  try {
    const answer = await fetch(`board/${version}`, { cache: "no-store", signal: AbortSignal.timeout(PATIENCE) });
    if (answer.ok) {
      const board = await answer.json();
      lost = false;
      if (board.version !== version) {
        version = board.version;
        draw(board);
      }
    }
  } catch {
    // The next one may get through.
  }
  element("lost").hidden = !lost;
  setTimeout(ask, BETWEEN);
}
ask();
