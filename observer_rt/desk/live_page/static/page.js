// The live page: it keeps what the server sends of every injector, and draws it by uPlot, live or held.
"use strict";

const styles = getComputedStyle(document.documentElement);
const [OBSERVER, NOMINAL, SECOND, THIRD, REFUSED, PAST, BAND, INK, GRID] =
  ["observer", "nominal", "second", "third", "refused", "past", "band", "ink", "grid"].map(
    (name) => styles.getPropertyValue(`--${name}`).trim());
const KEPT = 1000; // injections
const LATELY = 100; // of which the share of valid ones is shown
const BEFORE = 7; // that are drawn pale
const POINTS = 300; // of a curve at the most: a screen shows no more
const OLD = 2; // s, after which numbers are not those of now
const DETAILS_EVERY = 450, HISTORY_EVERY = 1000; // ms: nobody follows these injection by injection
const Z_95 = 1.96; // standard deviations to the ends of a 95 % interval
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
const WHOLE = [1, 10, 100, 1e3, 1e4, 1e5].flatMap((n) => [n, 2 * n, 5 * n]); // steps of an axis that counts
const NUMBER = { column: "number", label: "injection", axis: "injection", span: 20, incrs: WHOLE };
const RATE = {
  title: "Injection rate", unit: "mm³/ms", span: 10, least: 0, x: TIME,
  columns: (list) => {
    const columns = overlaid(list, { live: "rate_mm3_per_ms" }, {
      live_sigma: "rate_sigma_mm3_per_ms", corrected: "corrected_rate_mm3_per_ms", sigma: "corrected_rate_sigma_mm3_per_ms", nominal: "nominal_rate_mm3_per_ms",
    });
    const end = (rates, sigma, sign) => rates?.map((rate, k) => sum(rate, sign * Z_95, sigma?.[k]));
    const band = (low, high, rates, sigma) => ({ [low]: end(rates, sigma, -1), [high]: end(rates, sigma, 1) });
    const live = band("live_low", "live_high", columns.live, columns.live_sigma);
    return { ...columns, ...live, ...band("low", "high", columns.corrected, columns.sigma) };
  },
  series: [
    ...before("live"),
    ...ends("live"),
    unnamed("low", { stroke: BAND }),
    line("high", "95 %", BAND, { width: 1, value: halfOf }),
    line("nominal", "nominal", NOMINAL, { dash: [6, 6] }),
    line("corrected", "corrected", OBSERVER),
    line("live", "live", THIRD, { width: 1.2 }),
  ],
  bands: [["live_high", "live_low", `${THIRD}22`], ["high", "low", BAND]],
};
const DETAILS = {
  line_pressure: {
    title: "Line pressure", unit: "MPa", span: 20, x: TIME,
    columns: (list) => overlaid(list, { sensor: "line_pressure_MPa" }, { model: "modelled_pressure_MPa" }),
    series: [...measured("sensor"), line("model", "observer", SECOND, { dash: [6, 6] })],
  },
  rail_pressure: {
    title: "Rail pressure", unit: "MPa", span: 20, x: TIME,
    columns: (list) => overlaid(list, { sensor: "rail_pressure_MPa" }), series: measured("sensor"),
  },
  needle_lift: {
    title: "Needle lift", unit: "µm", span: 50, x: TIME,
    columns: (list) => overlaid(list, { sensor: "needle_lift_um" }), series: measured("sensor"),
  },
};
const HISTORY = {
  mass: {
    title: "Mass of each injection", unit: "mg", span: 1, x: NUMBER,
    columns: (list) => byNumber(list, (v, one) => ({
      nominal: one.nominal,
      ...banded(v.valid ? "valid" : "refused", v.mass_mg, sum(v.mass_mg, -1, v.mass_bound_mg), sum(v.mass_mg, 1, v.mass_bound_mg)),
    })),
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
    columns: (list) => byNumber(list, (v) => ({
      ...banded("nozzle", ...[v.nozzle_v_H, v.nozzle_v_H_ci95_low, v.nozzle_v_H_ci95_high].map(percent)),
      ...banded("seat", ...[v.seat_v_S, v.seat_v_S_ci95_low, v.seat_v_S_ci95_high].map(percent)),
    })),
    series: [...ends("nozzle"), ...ends("seat"), line("nozzle", "nozzle", OBSERVER), line("seat", "seat", SECOND)],
    bands: [
      ["nozzle_high", "nozzle_low", `${OBSERVER}33`],
      ["seat_high", "seat_low", `${SECOND}33`],
    ],
  },
};
// Of each flow and input: how the network has changed the flow, as the daemon knows it after the last event.
const INPUTS = {
  pressure_drop_MPa: "pressure drop, MPa", seat_area_mm2: "seat area, mm²",
  time_since_opening_ms: "time since the opening, ms", rail_pressure_MPa: "rail pressure, MPa",
};
const law = (flow, title, input) => [`${flow}_${input}`, {
  title, unit: "% of flow", span: 4, x: { column: "value", label: INPUTS[input], axis: INPUTS[input], span: 0.1 },
  columns: (list, told) => {
    const curve = told.learned.find((each) => each.flow === flow && each.variable === input);
    if (!curve) return {};
    const end = (sign) => curve.change.map((change, k) => percent(change + sign * curve.ci95_halfwidth[k]));
    return { value: curve.value, change: curve.change.map(percent), low: end(-1), high: end(1) };
  },
  series: [unnamed("low"), line("high", "95 %", BAND, { width: 1, value: halfOf }), line("change", "learned", OBSERVER)],
  bands: [["high", "low", BAND]],
}];
const LAWS = Object.fromEntries([
  ...Object.keys(INPUTS).map((input) => law("orifice_area", "Nozzle, as learned", input)),
  ...["seat_area_mm2", "pressure_drop_MPa"].map((input) => law("seat_area", "Seat, as learned", input)),
]);
const PANELS = { ...HISTORY, ...DETAILS, ...LAWS };

// What is not known is null, in numbers as in curves.
const sum = (value, sign, other) => (value == null || other == null ? null : value + sign * other);
const percent = (value) => (value == null ? null : 100 * value);
const banded = (name, middle, low, high) => ({ [name]: middle, [`${name}_low`]: low, [`${name}_high`]: high });

// Columns of injections by rising numbers: an observer that was started anew counts from 1 again.
function byNumber(list, columnsOf) {
  const rows = list.map((one) => ({ number: one.values.number, ...columnsOf(one.values, one) }));
  rows.sort((one, other) => one.number - other.number);
  const names = new Set(rows.flatMap(Object.keys));
  return Object.fromEntries([...names].map((name) => [name, rows.map((row) => row[name] ?? null)]));
}

// Curves of the last injection on one axis of time, and of those before it; none if it has none itself, for those of
// another one are not to stand for it. over, alone: their names by column; `NAME_before_K` is that of K injections ago.
function overlaid(list, over, alone = {}) {
  const drawn = list.slice(-1 - BEFORE).filter((one) => one.curves).reverse();
  if (!drawn.length || drawn[0] !== list.at(-1)) return {};
  const longest = drawn.map((one) => one.curves.time_ms).reduce((one, other) => (other.length > one.length ? other : one));
  const step = Math.ceil(longest.length / POINTS);
  const thinned = (values = []) => Array.from({ length: Math.ceil(longest.length / step) },
    (_, k) => (Number.isFinite(values[k * step]) ? values[k * step] : null));
  const columns = { time: thinned(longest) };
  for (const [name, curve] of Object.entries({ ...over, ...alone })) columns[name] = thinned(drawn[0].curves[curve]);
  for (const [name, curve] of Object.entries(over)) {
    drawn.slice(1).forEach((one, k) => { columns[`${name}_before_${k + 1}`] = thinned(one.curves[curve]); });
  }
  return columns;
}

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
const injectors = []; // name, what its daemon says, list of injections, the injection whose rate is drawn
let chosen = 0; // injector whose details are shown
let held = null; // lists of injections, while the page stands still
let place = 0; // of the one shown among those held
let now = 0; // ns since 1970, of the server
const due = { details: 0, history: 0, laws: 0 };
const drawnOf = {}; // what a group of panels was drawn of

function addPanel(id, { title, unit, span, least, x, series, columns, bands = [] }) {
  const spot = element(id);
  const all = [x, ...series.map((each) => ({ points: { show: false }, ...each }))].map(
    (each) => ({ value: (plot, value) => inShort(value), ...each }));
  const at = (column) => all.findIndex((each) => each.column === column);
  const grid = { stroke: GRID, width: 1 };
  const axis = (label, size) =>
    ({ label, size, grid, stroke: INK, font: FONT, labelFont: FONT, labelSize: 22 });
  const plot = new uPlot({
    title, width: 1, height: 1, series: all, // as large as its place, once that is known
    scales: { x: { time: false, range: steady(x.span, 0) }, y: { range: steady(span, 0.04, least) } },
    axes: [{ ...axis(x.axis, 30), incrs: x.incrs }, axis(unit, 66)],
    bands: bands.map(([high, low, fill]) => ({ series: [at(high), at(low)], fill })),
    cursor: { drag: { x: false, y: false } },
  }, all.map(() => []), spot);
  const fit = () => {
    const { clientWidth, clientHeight } = plot.root;
    const height = clientHeight - element(id).querySelector(".u-wrap").offsetTop;
    if (clientWidth > 0) plot.setSize({ width: clientWidth, height: Math.max(height, LOWEST) });
  };
  const resized = new ResizeObserver(fit);
  for (const each of [spot, ...plot.root.querySelectorAll(".u-title, .u-legend")]) resized.observe(each);
  spot.classList.add("empty");
  spot.dataset.empty = "no injection yet";
  panels[id] = { plot, title, columns, names: all.map((each) => each.column) };
}

function build(names) {
  names.forEach((name, k) => {
    const button = document.createElement("button");
    button.textContent = name;
    button.onclick = () => {
      chosen = k;
      place = lists()[k].length - 1;
      draw(true);
    };
    injectors.push({ name, told: {}, list: [] });
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
  element("laws").innerHTML = Object.keys(LAWS).map((id) => `<div id="${id}" class="plot"></div>`).join("");
  for (const [id, panel] of Object.entries(PANELS)) addPanel(id, panel);
}

// What is shown of every injector: all kept, or those held up to the one stepped to.
const lists = () => held ?? injectors.map(({ list }) => list);
const shownOf = (k) => (held && k === chosen ? held[k].slice(0, place + 1) : lists()[k]);
const numberOf = (one) => (one ? String(one.values.number ?? "") : "");
const escaped = (text) => String(text).replace(/[&<>"']/g, (letter) => `&#${letter.charCodeAt(0)};`);
const clock = (moment) => new Date(moment / 1e6).toTimeString().slice(0, 8);

function known(value, bound, unit, digits = 2, sign = "") {
  if (value == null) return "not known";
  const half = bound == null ? "" : `± ${bound.toFixed(2)} `;
  return `${value > 0 ? sign : ""}${value.toFixed(digits)} <small>${half}${unit}</small>`;
}

function bannerHtml({ name, told }) {
  const part = (each) => `<li>${escaped(each)}</li>`;
  const faults = told.faults.map(({ what, since, remedy, parts }) =>
    `<div class="fault"><b>${escaped(what)}</b>${parts.length ? `<ul>${parts.map(part).join("")}</ul>` : "<br>"}`
    + `since ${clock(since)}<br>to do: ${escaped(remedy)}</div>`);
  const level = faults.length ? "bad" : told.level;
  return `<div class="state ${level}${told.silent ? " silent" : ""}">${name && `<span class="name">${escaped(name)}</span>`}`
    + `<span class="what">${escaped(told.state)}</span><small>${escaped(told.words)}</small></div><div class="faults">`
    + `${faults.join("") || (level === "good" ? '<div class="well">no fault</div>' : "")}</div>`;
}

function numbersHtml({ told }, list) {
  const last = list.at(-1);
  if (!last) return '<div class="numbers"><div class="none">no injection yet</div></div>';
  const { values: v, moment, nominal } = last;
  const age = Math.max(0, (now - moment) / 1e9);
  const ago = age < 60 ? `${age.toFixed(0)} s ago` : `${(age / 60).toFixed(0)} min ago`;
  const lately = list.slice(-LATELY);
  const valid = 100 * lately.filter((one) => one.values.valid).length / lately.length;
  const wear = (name) => known(percent(v[name]), sum(percent(v[`${name}_ci95_high`]), -1, percent(v[name])), "%", 2, "+");
  const row = (heading, html, kind = "") => `<tr${kind && ` class="${kind}"`}><th>${heading}</th><td>${html}</td></tr>`;
  return `<div class="numbers${age > OLD || told.silent ? " old" : ""}"><div class="mass">${known(v.mass_mg, v.mass_bound_mg, "mg")}</div><table>`
    + row("injection", `${numberOf(last)} <small>${[v.verdict, v.remainder, ago].filter(Boolean).map(escaped).join(", ")}</small>`)
    + row("rail pressure", known(v.rail_pressure_MPa, null, "MPa", 1), "minor")
    + row("nominal", known(nominal, null, "mg"), "minor")
    + row("density", known(v.density_kg_per_m3, null, "kg/m³", 0), "minor")
    + row("nozzle flow", wear("nozzle_v_H")) + row("seat flow", wear("seat_v_S"))
    + row("valid lately", `${valid.toFixed(0)} % <small>of ${lately.length}</small>`)
    + row("lost by the observer", `${told.lost} <small>samples and frames</small>`, told.lost ? "" : "minor")
    + "</table></div>";
}

function showTop(buses) {
  element("top").innerHTML = `<b>observer_rt</b> <span>live ${clock(now)}</span>` + buses.map((bus) =>
    `<span class="bus ${bus.down ? "bad" : ""}">${escaped(bus.label)}${bus.down ? ` down: ${escaped(bus.down)}` : ""}</span>`).join("");
}

function showControls() {
  injectors.forEach((_, k) => {
    element("names").children[k].setAttribute("aria-pressed", k === chosen);
    element(`injector_${k}`).classList.toggle("chosen", k === chosen && injectors.length > 1);
  });
  const last = held ? held[chosen].length - 1 : 0;
  element("hold").textContent = held ? "Go on" : "Hold";
  element("place").hidden = last < 1;
  element("place").max = Math.max(last, 0);
  element("place").value = place;
  element("place").title = `${place + 1} of ${last + 1} kept`;
}

// Draw a panel of an injector's list of injections: title, curves.
function drawPanel(id, k, list) {
  const { plot, title, columns, names } = panels[id];
  const found = list.length ? columns(list, injectors[k].told) : {};
  const number = numberOf(list.at(-1));
  element(id).classList.toggle("empty", !found[names[0]]?.length);
  plot.setData(names.map((name) => found[name] ?? found[names[0]]?.map(() => null) ?? []));
  plot.root.querySelector(".u-title").textContent = [title, injectors[k].name].filter(Boolean).join(" ")
    + (names[0] === "time" && number ? `, no. ${number}` : "");
  element(id).dataset.empty = number ? "no curves of it" : "no injection yet";
}

// Draw a group of panels of the chosen injector if there is something new for it, and it is due.
function drawGroup(name, group, every, atOnce) {
  const list = shownOf(chosen), state = list.at(-1);
  if (!atOnce && (drawnOf[name] === state || performance.now() < due[name])) return false;
  drawnOf[name] = state;
  due[name] = performance.now() + every;
  for (const id of Object.keys(group)) drawPanel(id, chosen, list);
  return true;
}

function change(id, html) {
  if (element(id).dataset.html === html) return;
  element(id).dataset.html = element(id).innerHTML = html;
}

// Mass and rate of an injection are drawn together; of the rest one group at a time, so that nothing takes long.
function draw(atOnce = false) {
  injectors.forEach((injector, k) => {
    const list = shownOf(k), last = list.at(-1);
    change(`banner_${k}`, bannerHtml(injector));
    change(`numbers_${k}`, numbersHtml(injector, list));
    element(`injector_${k}`).classList.toggle("dead", injector.told.silent);
    if (injector.drawn !== last || atOnce) {
      injector.drawn = last;
      drawPanel(`rate_${k}`, k, list);
    }
  });
  element("details").classList.toggle("dead", injectors[chosen].told.silent);
  const isDrawn = drawGroup("details", DETAILS, DETAILS_EVERY, atOnce);
  if (!isDrawn || atOnce) drawGroup("history", HISTORY, HISTORY_EVERY, atOnce);
  drawnOf.laws = null; // its curves come apart from the injections
  if (!element("laws").hidden) drawGroup("laws", LAWS, HISTORY_EVERY, atOnce);
  showControls();
}

// A message: the length of its text, the text, then the values of all curves one after the other.
function take(message) {
  let from = 4 + new DataView(message).getUint32(0, true);
  const text = new TextDecoder().decode(new Uint8Array(message, 4, from - 4));
  const content = JSON.parse(text);
  if (content.names) build(content.names);
  if (content.notice !== undefined) element("said").textContent = content.notice;
  now = content.now;
  showTop(content.buses);
  content.injectors.forEach(({ news, ...told }, k) => {
    injectors[k].told = told;
    const { list } = injectors[k];
    for (const { curves, samples, ...one } of news) {
      if (curves.length) {
        one.curves = {};
        for (const name of curves) {
          one.curves[name] = new Float32Array(message, from, samples);
          from += 4 * samples;
        }
      }
      if (!(one.count <= list.at(-1)?.count)) list.push(one);
      else { // its curves were asked for
        Object.assign(lists()[k].find((each) => each.count === one.count) ?? {}, one);
        drawnOf.details = injectors[k].drawn = null;
      }
    }
    list.splice(0, list.length - KEPT);
  });
  return content.number;
}

// Stand still at the newest injection, or go on.
function hold(isHeld) {
  if (!injectors.length) return;
  held = isHeld ? injectors.map(({ list }) => [...list]) : null;
  place = held ? held[chosen].length - 1 : 0;
}

function step(to) {
  if (!held) hold(true);
  if (!held) return;
  place = Math.max(0, Math.min(to(place), held[chosen].length - 1));
  const one = held[chosen][place];
  if (one && !one.curves && !one.isAsked) {
    one.isAsked = true;
    press("curves", chosen, one.count);
  }
  draw(true);
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
const press = (button, of = 0, count = 0) => {
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify([button, of, count]));
};
element("hold").onclick = () => {
  hold(!held);
  if (injectors.length) draw(true);
};
element("save").onclick = () => injectors.length && press("save", chosen, shownOf(chosen).at(-1)?.count ?? 0);
element("back").onclick = () => step((before) => before - 1);
element("forth").onclick = () => step((before) => before + 1);
element("place").oninput = () => step(() => element("place").valueAsNumber);
element("correction").onclick = ({ target }) => {
  element("laws").hidden = !element("laws").hidden;
  target.setAttribute("aria-pressed", !element("laws").hidden);
  if (injectors.length) draw(true);
};

const waiting = []; // messages, drawn together in the next frame, and answered with the number of the last one
let heard = Infinity; // when last; before the first message there is nothing old
socket.binaryType = "arraybuffer";
socket.onmessage = ({ data }) => {
  heard = performance.now();
  if (isLost()) find();
  if (data.byteLength === 0 || waiting.push(data) > 1) return;
  requestAnimationFrame(() => {
    const number = waiting.splice(0).map(take).at(-1);
    draw();
    press("drawn", number);
  });
};
socket.onclose = lose;
setInterval(() => performance.now() - heard > SILENT_AFTER && lose(), SILENT_AFTER / 6);
matchMedia("(prefers-color-scheme: dark)").onchange = () => location.reload();
window.addEventListener("beforeunload", () => { socket.onclose = null; });
