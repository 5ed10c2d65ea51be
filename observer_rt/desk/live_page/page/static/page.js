// The live page: panels by uPlot, drawn as the server sends their columns, and buttons, which the server follows.
"use strict";

const styles = getComputedStyle(document.documentElement);
const [OBSERVER, NOMINAL, SECOND, THIRD, REFUSED, PAST, BAND, INK, GRID] =
  ["observer", "nominal", "second", "third", "refused", "past", "band", "ink", "grid"].map(
    (name) => styles.getPropertyValue(`--${name}`).trim());
const BEFORE = 7; // injections that are drawn pale
const FONT = "16px system-ui, sans-serif"; // to be read from two metres
const LOWEST = 80; // px of curves with their axes
const ROW = [0, 1, 2, 3, 2, 3, 3]; // injectors side by side, of so many; 4 of more
const WIDEST = 3; // times what is to be seen that an axis shows at the most
const SILENT_AFTER = 1500; // ms without a message, after which the server is lost: it sends two a second at least
const AGAIN_AFTER = 1000; // ms, from one look for a lost server to the next

// Series by the names of their columns. Of a band, low and high are series that are not drawn themselves.
const line = (column, label, stroke, more = {}) => ({ column, label, stroke, width: 3, ...more });
const unnamed = (column, more) => ({ column, class: "unnamed", ...more });
const ends = (name) => [unnamed(`${name}_low`), unnamed(`${name}_high`)];
const before = (name) => Array.from({ length: BEFORE }, (_, k) =>
  unnamed(`${name}_before_${BEFORE - k}`, { stroke: PAST, width: 1.5 }));
const measured = (name) => [...before(name), line(name, "sensor", OBSERVER)];

// Strokes at each point instead of a line: from the value of the series before, or so many px to both sides.
const strokes = (half) => (plot, number, first, last) => {
  const stroke = new Path2D();
  const [x, from, to] = [plot.data[0], plot.data[half ? number : number - 1], plot.data[number]];
  for (let k = first; k <= last; k++) {
    if (to[k] === null) continue;
    const across = plot.valToPos(x[k], "x", true);
    stroke.moveTo(across - half * uPlot.pxRatio, plot.valToPos(from[k], "y", true));
    stroke.lineTo(across + half * uPlot.pxRatio, plot.valToPos(to[k], "y", true));
  }
  return { stroke };
};
const dots = (column, label, stroke) => ({ column, label, stroke, width: 5, paths: strokes(2.5) });
const bars = (name, stroke) => [unnamed(`${name}_low`), unnamed(`${name}_high`, { stroke, paths: strokes(0) })];

// What the legend says of a value under the pointer; of a band's upper end how far it is from the middle.
const inShort = (value, digits = 4) => (value === null ? "" : String(Number(value.toPrecision(digits))));
const halfOf = (plot, high, number, at) =>
  (high === null ? "" : `± ${inShort((high - plot.data[number - 1][at]) / 2, 2)}`);

// Of each panel: title, unit, and `span`, what its axis shows at least, so that noise looks like noise.
const TIME = { column: "time", label: "ms", axis: "time, ms", span: 1 };
const NUMBER = { column: "number", label: "injection", axis: "injection", span: 20 };
const RATE = {
  title: "Injection rate", unit: "mm³/ms", span: 10, least: 0, x: TIME,
  series: [
    ...before("rate"),
    unnamed("low", { stroke: BAND }),
    line("high", "95 %", BAND, { width: 1, value: halfOf }),
    line("nominal", "nominal", NOMINAL, { width: 4, dash: [6, 6] }),
    line("rate", "observer", OBSERVER, { width: 4 }),
  ],
  bands: [["high", "low", BAND]],
};
const PANELS = {
  line_pressure: { title: "Line pressure", unit: "MPa", span: 20, x: TIME, series: measured("line_pressure") },
  rail_pressure: { title: "Rail pressure", unit: "MPa", span: 20, x: TIME, series: measured("rail_pressure") },
  needle_lift: { title: "Needle lift", unit: "µm", span: 50, x: TIME, series: measured("needle_lift") },
  phi: {
    title: "Correction φ, 1/s, own scales", span: 10, x: TIME,
    series: [
      line("phi_1", "φ₁ line pressure", OBSERVER, { scale: "1" }),
      line("phi_2", "φ₂ line flow", SECOND, { scale: "2" }),
      line("phi_3", "φ₃ sac pressure", THIRD, { scale: "3" }),
    ],
  },
  mass: {
    title: "Mass of each injection", unit: "mg", span: 1, x: NUMBER,
    series: [
      ...bars("valid", `${OBSERVER}80`),
      ...bars("refused", `${REFUSED}80`),
      { column: "nominal", label: "nominal", stroke: NOMINAL, width: 1, paths: strokes(4) },
      dots("valid", "observer", OBSERVER),
      dots("refused", "not valid", REFUSED),
    ],
  },
  wear: {
    title: "Wear", unit: "% of flow", span: 2, x: NUMBER,
    series: [...ends("nozzle"), ...ends("seat"), line("nozzle", "nozzle", OBSERVER), line("seat", "seat", SECOND)],
    bands: [
      ["nozzle_high", "nozzle_low", `${OBSERVER}33`],
      ["seat_high", "seat_low", `${SECOND}33`],
    ],
  },
};

// Round ends around values from low to high, at least `span` apart; those before where they are not too wide.
function roundEnds(low, high, span, before) {
  const needed = Math.max(high - low, span);
  const had = before[1] - before[0];
  if (before[0] <= low && high <= before[1] && span <= had && had <= WIDEST * needed) return before;
  const step = 10 ** Math.floor(Math.log10(needed)) / 2;
  const middle = (low + high) / 2;
  return [
    Math.floor(Math.min(low, middle - span / 2) / step) * step,
    Math.ceil(Math.max(high, middle + span / 2) / step) * step,
  ];
}

// The range of an axis: it stays as long as it can. margin: beside what is to be seen, as a share of it.
// least: the value that nothing but noise lies below.
function steady(span, margin, least = -Infinity) {
  let range = [0, span];
  return (plot, low, high) => {
    const beside = margin * (high - low);
    if (low !== null) range = roundEnds(Math.max(low - beside, least), high + beside, span, range);
    return range;
  };
}

const element = (id) => document.getElementById(id);
const panels = {}; // by the element they stand in
let shown = { names: [], chosen: 0 }; // injectors, and whose details are shown

function addPanel(id, { title, unit, span, least, x, series, bands = [] }) {
  const place = element(id);
  const all = [x, ...series.map((each) => ({ points: { show: false }, ...each }))].map(
    (each) => ({ value: (plot, value) => inShort(value), ...each }));
  const at = (column) => all.findIndex((each) => each.column === column);
  const grid = { stroke: GRID, width: 1 };
  const axis = (label, size) =>
    ({ label, size, grid, stroke: INK, font: FONT, labelFont: FONT, labelSize: 22 });
  const plot = new uPlot({
    title, width: 1, height: 1, series: all, // as large as its place, once that is known
    scales: Object.fromEntries([
      ["x", { time: false, range: steady(x.span, 0) }],
      ...all.slice(1).map(({ scale = "y" }) => [scale, { range: steady(span, 0.04, least) }]),
    ]),
    axes: unit ? [axis(x.axis, 30), axis(unit, 66)] : [axis(x.axis, 30)],
    bands: bands.map(([high, low, fill]) => ({ series: [at(high), at(low)], fill })),
    cursor: { drag: { x: false, y: false } },
  }, all.map(() => []), place);
  const fit = () => {
    const { clientWidth, clientHeight } = plot.root;
    const height = clientHeight - element(id).querySelector(".u-wrap").offsetTop;
    if (clientWidth > 0) plot.setSize({ width: clientWidth, height: Math.max(height, LOWEST) });
  };
  const resized = new ResizeObserver(fit);
  for (const each of [place, ...plot.root.querySelectorAll(".u-title, .u-legend")]) resized.observe(each);
  place.classList.add("empty");
  place.dataset.empty = "no injection yet";
  panels[id] = { plot, title, names: all.map((each) => each.column) };
}

function build(names) {
  names.forEach((name, k) => {
    const button = document.createElement("button");
    button.textContent = name;
    button.onclick = () => press("choose", k);
    element("names").append(button);
    element("injectors").insertAdjacentHTML("beforeend",
      `<div id="injector_${k}" class="injector"><div class="letters"><div id="banner_${k}"></div>`
      + `<div id="numbers_${k}"></div></div><div id="rate_${k}" class="plot"></div></div>`);
  });
  const all = element("injectors");
  all.className = names.length === 1 ? "alone" : names.length === 2 ? "few" : names.length === 3 ? "wall tall" : "wall";
  all.style.setProperty("--columns", ROW[names.length] ?? 4);
  element("names").hidden = names.length === 1;
  names.forEach((name, k) => addPanel(`rate_${k}`, RATE));
  for (const [id, panel] of Object.entries(PANELS)) addPanel(id, panel);
}

function showControls({ names, chosen, held, place, last, said, asks }) {
  if (!element("names").hasChildNodes()) build(names);
  shown = { names, chosen };
  names.forEach((_, k) => {
    element("names").children[k].setAttribute("aria-pressed", k === chosen);
    element(`injector_${k}`).classList.toggle("chosen", k === chosen && names.length > 1);
  });
  element("hold").textContent = held ? "Go on" : "Hold";
  element("place").hidden = last === 0;
  element("place").max = last;
  element("place").value = place;
  element("place").title = `${place + 1} of ${last + 1} kept`;
  element("said").textContent = said;
  element("missing").hidden = !asks;
}

// Whose curves these are; numbers: of the injections of all injectors.
function showTitle(id, numbers) {
  const { plot, title, names } = panels[id];
  const [, own] = id.match(/^rate_(\d+)$/) ?? [];
  const of = own ?? shown.chosen;
  const number = names[0] === "time" && numbers[of] ? `, no. ${numbers[of]}` : "";
  plot.root.querySelector(".u-title").textContent = [title, shown.names[of]].filter(Boolean).join(" ") + number;
  element(id).dataset.empty = numbers[of] ? "no curves of it" : "no injection yet";
}

// What is dead is not to look alive: an observer that is silent.
function showDead() {
  const dead = shown.names.map((_, k) => element(`banner_${k}`).querySelector(".silent") !== null);
  dead.forEach((each, k) => element(`injector_${k}`).classList.toggle("dead", each));
  element("details").classList.toggle("dead", dead[shown.chosen] === true);
}

// A message: the length of its text, the text, then the values of all columns one after the other.
function show(message) {
  let from = 4 + new DataView(message).getUint32(0, true);
  const text = new TextDecoder().decode(new Uint8Array(message, 4, from - 4));
  const { number, controls, letters = {}, injections, columns } = JSON.parse(text);
  if (controls) showControls(controls);
  for (const [id, html] of Object.entries(letters)) element(id).innerHTML = html;
  showDead();
  for (const [id, lengths] of Object.entries(columns)) {
    const { plot, names } = panels[id];
    const found = {};
    for (const [name, length] of Object.entries(lengths)) {
      const values = new Float32Array(message, from, length);
      found[name] = Array.from(values, (value) => (Number.isFinite(value) ? value : null));
      from += 4 * length;
    }
    element(id).classList.toggle("empty", !found[names[0]]?.length);
    plot.setData(names.map((name) => found[name] ?? []));
    showTitle(id, injections);
  }
  return number;
}

// Nothing comes: nobody is to take what stands there for the present. Loaded anew once the server is there again.
function lose() {
  if (isLost()) return;
  element("lost").textContent = `No connection to observer-rt monitor since ${new Date().toTimeString().slice(0, 8)}: `
    + "all below is old. To do: see that it runs and can be reached; the page goes on by itself.";
  document.body.classList.add("lost");
  again(look);
}
function find() {
  element("lost").textContent = "";
  document.body.classList.remove("lost");
}
const isLost = () => document.body.classList.contains("lost");
const again = (what) => setTimeout(() => isLost() && what(), AGAIN_AFTER);
// a server that answers sends something soon, too, unless the connection is none any more
const look = () => fetch(location.href).then(() => again(() => location.reload()), () => again(look));

const socket = new WebSocket(new URL("drawings", location.href.replace(/^http/, "ws")));
const press = (button, value = 0) => {
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify([button, value]));
};
for (const button of ["hold", "save"]) element(button).onclick = () => press(button);
element("back").onclick = () => press("step", -1);
element("forth").onclick = () => press("step", 1);
element("correction").onclick = ({ target }) => {
  element("phi").hidden = !element("phi").hidden;
  target.setAttribute("aria-pressed", !element("phi").hidden);
};
element("place").oninput = () => press("place", element("place").valueAsNumber);

const waiting = []; // messages, drawn together in the next frame, and answered with the number of the last one
let heard = Infinity; // when last; before the first message there is nothing old
socket.binaryType = "arraybuffer";
socket.onmessage = ({ data }) => {
  heard = performance.now();
  if (isLost()) find();
  if (data.byteLength === 0 || waiting.push(data) > 1) return;
  requestAnimationFrame(() => press("drawn", waiting.splice(0).map(show).at(-1)));
};
socket.onclose = lose;
setInterval(() => performance.now() - heard > SILENT_AFTER && lose(), SILENT_AFTER / 6);
matchMedia("(prefers-color-scheme: dark)").onchange = () => location.reload();
window.addEventListener("beforeunload", () => { socket.onclose = null; });
