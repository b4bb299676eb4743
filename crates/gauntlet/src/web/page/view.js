// The page's side of the conversation: draws the newest picture and asks for the next, and says while a person holds the clutch.
//
// Nothing here closes the clutch but a button or a key that is pressed now. Each word to the program names the picture that was drawn
// last: whoever sees old pictures moves nothing.

import { FINGERS, Stage } from "./bodies.js";

const $ = (id) => document.getElementById(id);
const TOUCH = matchMedia("(pointer: coarse)").matches;
const BEAT = 100; // ms between two heartbeats: the bridge holds after 250
const ANSWER = 700; // ms for the program to say that this page holds the clutch
const MINUTE = 60;
const NAMES = ["thumb", "index", "middle", "ring", "little"];
const THEMES = {
  dark: { skin: [214, 209, 202], metal: [128, 137, 150], haze: [23, 28, 37], seam: "rgb(8 10 14 / 0.5)", floor: "rgb(120 145 180 / 0.16)", ring: "rgb(160 180 205 / 0.13)", shadow: "rgb(0 0 0 / 0.75)", ghost: "#F0E442" },
  light: { skin: [226, 215, 203], metal: [142, 150, 162], haze: [236, 239, 243], seam: "rgb(40 48 60 / 0.4)", floor: "rgb(90 110 140 / 0.14)", ring: "rgb(60 80 110 / 0.16)", shadow: "rgb(30 40 60 / 0.45)", ghost: "#0072B2" },
};

const HOLD = TOUCH ? "the button" : "space";
const ESCAPE = TOUCH ? "“open”" : "Esc";

let socket = null;
let page = 0;
let picture = null;
let seen = 0;
let map = null;
let over = "";
let tries = 0;
let drawing = false;
const series = { frames: [], cycles: [], latency: [] };

const stages = {
  hand: new Stage($("hand"), { yaw: Math.PI + 0.62, pitch: 0.16, target: [4, -8, 84], span: 274, floor: -22 }),
  gripper: new Stage($("gripper"), { yaw: Math.PI - 0.95, pitch: 0.36, target: [0, 0, 70], span: 300, floor: -50 }),
};
for (const stage of Object.values(stages)) stage.moved = () => redraw();

// -- The theme, the mirror

function theme() {
  return document.documentElement.dataset.theme;
}

function setTheme(name) {
  document.documentElement.dataset.theme = name;
  $("theme").textContent = name === "dark" ? "light" : "dark";
  redraw();
}

function toggleMirror() {
  stages.hand.mirrored = !stages.hand.mirrored;
  $("mirror").setAttribute("aria-pressed", stages.hand.mirrored);
  redraw();
}

// -- The conversation

function connect() {
  const address = new URL("socket", location.href);
  address.protocol = "ws:";
  address.hash = "";
  const opened = new WebSocket(address);
  socket = opened;
  opened.onmessage = (event) => {
    const message = JSON.parse(event.data);
    if (message.is === "hello") [page, tries] = [message.page, 0];
    if (message.is === "map") map = message.map;
    if (message.is === "picture") {
      picture = { ...message.picture, number: message.number };
      remember(picture);
    }
    redraw();
  };
  opened.onclose = (event) => {
    if (socket !== opened) return;
    socket = null;
    letGo();
    over = event.reason;
    redraw();
    // The program may only have been out of reach; one that has ended is not asked again.
    if (!over && ++tries <= 30) setTimeout(() => socket || connect(), 1000);
  };
}

function say(word, more = {}) {
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ is: word, seen, ...more }));
}

// A page that is not drawn asks for no pictures, and is not forgotten.
setInterval(() => say("ready"), 5000);

// -- The clutch: held down, or open

let held = null; // when it was pressed

function press() {
  if (held !== null || !mayClose()) return;
  held = performance.now();
  say("close");
  redraw();
}

function letGo() {
  if (held === null) return;
  held = null;
  say("open");
  redraw();
}

setInterval(() => {
  if (held === null) return;
  const mine = picture?.clutch?.page === page;
  // It opened meanwhile, or somebody else has it: what is held down now closes nothing any more.
  if (!mine && performance.now() - held > ANSWER) held = null;
  else say("beat");
}, BEAT);

function mayClose() {
  const clutch = picture?.clutch;
  return socket?.readyState === WebSocket.OPEN && clutch?.may_close && (clutch.position === "open" || clutch.position === "expired");
}

function clutchWords() {
  const clutch = picture?.clutch;
  if (!clutch) return "";
  const mine = clutch.page === page;
  switch (clutch.position) {
    case "open":
      return !clutch.may_close ? "clutch open" : held === null ? `clutch open: hold ${HOLD}` : "closing the clutch";
    case "expired":
      return clutch.may_close ? `clutch opened by itself: hold ${HOLD}` : "clutch opened by itself";
    case "lost":
      return "clutch: no heartbeat, held";
    default:
      if (mine) return "clutch closed: let go to open";
      if (clutch.page !== null) return `clutch held on another page: ${ESCAPE} opens it`;
      return clutch.terminal ? `clutch closed where the program runs: ${ESCAPE} opens it` : `clutch closed elsewhere: ${ESCAPE} opens it`;
  }
}

$("clutch").addEventListener("pointerdown", (event) => {
  if (event.button !== 0) return;
  event.preventDefault();
  $("clutch").focus();
  $("clutch").setPointerCapture(event.pointerId);
  press();
});
for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) $("clutch").addEventListener(end, letGo);
$("clutch").addEventListener("contextmenu", (event) => event.preventDefault());
$("open").addEventListener("click", () => {
  held = null;
  say("open");
});
addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  if (event.key === "Escape") {
    held = null;
    say("open");
  } else if (event.key === " ") {
    // On another button, space presses that.
    const other = document.activeElement?.closest("button, summary");
    if (other && other.id !== "clutch") return;
    event.preventDefault();
    if (event.repeat) return;
    if (picture?.clutch) press();
    else act(" ");
  } else if (!event.repeat) {
    if (event.key === "m") toggleMirror();
    if (event.key === "t") setTheme(theme() === "dark" ? "light" : "dark");
    act(event.key);
  }
});

// Keys that a page does something else with, or that are half of another.
const OTHERS = /^(m|t|q| |Escape|Tab|Home|Arrow.*|Shift|Control|Alt|AltGraph|Meta|CapsLock|NumLock|Dead|Unidentified)$/;

function act(key) {
  const of = (name) => picture?.actions.find((each) => each.key === name);
  // Enter on a button presses that.
  const pressed = key === "Enter" && document.activeElement?.closest("button, summary");
  const action = of(key) ?? (OTHERS.test(key) || pressed ? null : of("any"));
  if (action) say("do", { what: action.name });
}

// A button that was clicked gives the keyboard back: space is for the clutch.
addEventListener("click", (event) => event.detail > 0 && event.target.closest?.("button, summary")?.blur());
addEventListener("keyup", (event) => event.key === " " && letGo());
// Whoever looks elsewhere holds nothing.
addEventListener("blur", letGo);
document.addEventListener("visibilitychange", () => {
  if (document.hidden) letGo();
  else if (!socket && !over) connect();
});
addEventListener("pagehide", () => {
  letGo();
  socket?.close();
});

// -- What is shown

function redraw() {
  if (drawing) return;
  drawing = true;
  requestAnimationFrame(() => {
    drawing = false;
    draw();
    if (picture && picture.number !== seen) {
      seen = picture.number;
      say("ready");
    }
  });
}

function put(id, text) {
  const element = $(id);
  if (element.textContent !== text) element.textContent = text;
}

function show(id, shown) {
  $(id).hidden = !shown;
}

function list(id, lines) {
  const key = JSON.stringify(lines);
  if ($(id).dataset.key === key) return;
  $(id).dataset.key = key;
  $(id).replaceChildren(...lines.map((line) => Object.assign(document.createElement("li"), { textContent: line })));
}

let spoken = ["", 0];

// The state for who listens: when it has changed, once a second at most.
function speak(words) {
  const now = performance.now();
  if (words === spoken[0] || now - spoken[1] < 1000) return;
  spoken = [words, now];
  put("live", words);
}

function headline() {
  let state = picture?.state ?? { words: "connecting", tone: "wait" };
  if (over) state = { words: over, tone: "wait" };
  else if (!socket && picture) state = { words: "connection lost: the clutch opens by itself", tone: "bad" };
  const words = socket ? clutchWords() : "";
  put("state", state.words);
  $("state").dataset.tone = state.tone;
  put("clutch-words", words);
  const teach = picture?.teach;
  speak([state.words, words, teach && (teach.refused || teach.words)].filter(Boolean).join(", "));
}

function clutchBar() {
  const clutch = socket && picture?.clutch;
  show("clutch-bar", clutch?.may_close);
  if (!clutch?.may_close) return;
  const closed = clutch.position === "closed" || clutch.position === "lost";
  const mine = clutch.page === page;
  $("clutch").classList.toggle("closed", closed && mine);
  const elsewhere = clutch.terminal ? "closed by the program" : "closed elsewhere";
  put("clutch", closed ? (mine ? "let go to open" : elsewhere) : TOUCH ? "hold to follow" : "hold to follow (space)");
  $("clutch").disabled = closed && !mine;
  $("clutch").setAttribute("aria-pressed", closed && mine);
  $("open").disabled = !closed;
}

function drawHand() {
  const hand = picture.hand;
  show("hand-stage", hand);
  show("sensors-panel", hand?.sensors.length > 0);
  if (!hand) return;
  const marks = hand.sensors.filter((each) => each.at).map((each) => ({ at: each.at, health: each.health, sigma: each.sigma_deg }));
  const old = hand.age_s !== null;
  stages.hand.draw({ solid: hand.links, marks, faded: old, theme: THEMES[theme()] });
  const side = hand.left ? "left hand" : "right hand";
  put("hand-name", stages.hand.mirrored ? `${side}, mirrored` : side);
  put("hand-note", old ? `${hand.age_s.toFixed(1)} s old` : hand.calibrated ? "" : "not calibrated");
  sensors(hand);
}

function sensors(hand) {
  const good = hand.sensors.filter((each) => each.health === "good").length;
  const known = hand.sensors.filter((each) => each.sigma_deg !== null);
  const worst = known.reduce((a, b) => (a && a.sigma_deg >= b.sigma_deg ? a : b), null);
  const sure = worst ? `; least sure: ${worst.name.replace("_", " ")}, ±${worst.sigma_deg.toFixed(1)}°` : "";
  put("sensors-words", `${good} of ${hand.sensors.length} good${sure}`);
  if (!document.querySelector("#sensors-panel details[open]")) return;
  rows("sensors", hand.sensors.map((each) => [each.name, each.words, each.sigma_deg === null ? "" : `±${each.sigma_deg.toFixed(1)}°`]));
  rows("angles", NAMES.map((name, k) => [name, ...hand.angles_deg.slice(5 * k, 5 * k + 5).map((angle) => angle?.toFixed(1) ?? "–")]));
}

function rows(id, values) {
  const table = $(id);
  while (table.rows.length < values.length) table.insertRow();
  values.forEach((cells, k) => {
    const row = table.rows[k];
    cells.forEach((text, c) => {
      const cell = row.cells[c] ?? row.insertCell();
      if (c && /^[±–\d-]/.test(text)) cell.className = "number";
      if (cell.textContent !== text) cell.textContent = text;
    });
  });
}

function drawGripper() {
  const { gripper, teach } = picture;
  show("gripper-stage", gripper || teach);
  show("axes-panel", gripper?.axes.length > 0);
  if (!gripper && !teach) return;
  const shown = teach?.target.length ? teach.target : gripper?.reached ?? [];
  const ghost = teach?.target.length ? gripper?.reached ?? [] : gripper?.asked ?? [];
  const old = gripper && gripper.age_s !== null;
  const tips = ["A", "B", "C"].map((text, finger) => {
    const links = shown.filter((link) => link[8] === 200 + finger);
    const tip = links[links.length - 1];
    return tip && links.length === 4 && { text, at: [tip[3], tip[4], tip[5] + 16], color: FINGERS[finger] };
  });
  stages.gripper.draw({ solid: shown, ghost, names: tips.filter(Boolean), faded: old && !teach, theme: THEMES[theme()] });
  const imagined = gripper?.is_imagined;
  put("gripper-name", teach ? "show this pose" : imagined ? "your hand by the map" : "gripper");
  put("gripper-note", teach ? (ghost.length ? "outline: your hand by the map so far" : "") : imagined ? "no gripper moves" : old ? `position ${gripper.age_s.toFixed(1)} s old` : "outline: asked");
  put("axes-name", imagined ? "asked, and your hand by the map, counts" : "gripper: asked and reached, counts");
  if (gripper) axes(gripper.axes);
}

function axes(all) {
  const holder = $("axes");
  while (holder.children.length < all.length) {
    const row = document.createElement("div");
    row.className = "axis";
    row.innerHTML = '<span></span><div class="track"><div class="fill"></div><div class="asked"></div></div><span class="number"></span>';
    holder.append(row);
  }
  all.forEach((axis, k) => {
    const [name, track, number] = holder.children[k].children;
    if (name.textContent !== axis.name) name.textContent = axis.name;
    const [fill, asked] = track.children;
    fill.style.width = `${((axis.reached ?? 0) / 255) * 100}%`;
    fill.style.background = FINGERS[k] ?? "#8C8C8C";
    asked.hidden = axis.asked === null;
    asked.style.left = `calc(${((axis.asked ?? 0) / 255) * 100}% - 1px)`;
    const text = `${axis.asked ?? "–"} → ${axis.reached ?? "–"}`;
    if (number.firstChild?.textContent !== text || number.lastChild?.textContent !== axis.word) {
      number.replaceChildren(text, Object.assign(document.createElement("small"), { textContent: axis.word }));
    }
  });
}

// -- A minute of rates

function remember({ elapsed_s, rates }) {
  if (!rates) return;
  const values = { frames: rates.frames_per_s, cycles: rates.cycles_per_s, latency: rates.latency_p99_us === null ? null : rates.latency_p99_us / 1000 };
  for (const [name, value] of Object.entries(values)) {
    const points = series[name];
    const last = points[points.length - 1];
    if (last && elapsed_s < last[0]) points.length = 0;
    if (value === null || (last && elapsed_s - last[0] < 0.25)) continue;
    points.push([elapsed_s, value]);
    while (points[0][0] < elapsed_s - MINUTE) points.shift();
  }
}

function sized(canvas) {
  const scale = Math.min(2, window.devicePixelRatio || 1);
  const [width, height] = [Math.round(canvas.clientWidth * scale), Math.round(canvas.clientHeight * scale)];
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  const context = canvas.getContext("2d");
  context.clearRect(0, 0, width, height);
  return { context, width, height, scale };
}

function style(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name);
}

function plot(id, points, color) {
  const { context, width, height, scale } = sized($(id));
  context.fillStyle = style("--edge");
  context.fillRect(0, height - scale, width, scale);
  if (points.length < 2) return;
  const end = points[points.length - 1][0];
  const most = Math.max(...points.map((point) => point[1])) * 1.15 || 1;
  context.beginPath();
  points.forEach(([at, value], k) => {
    const x = width - ((end - at) / MINUTE) * width;
    const y = height - scale - (value / most) * (height - 3 * scale);
    k ? context.lineTo(x, y) : context.moveTo(x, y);
  });
  context.lineWidth = 1.8 * scale;
  context.lineJoin = "round";
  context.strokeStyle = color;
  context.stroke();
}

let plotted = 0;

function rates() {
  const rates = picture.rates;
  show("rates", rates);
  const now = performance.now();
  if (!rates || now - plotted < 250) return;
  plotted = now;
  show("row-cycles", rates.cycles_per_s !== null);
  show("row-latency", rates.cycles_per_s !== null);
  plot("plot-frames", series.frames, FINGERS[0]);
  plot("plot-cycles", series.cycles, FINGERS[1]);
  plot("plot-latency", series.latency, FINGERS[2]);
  put("frames", `${rates.frames_per_s.toFixed(1)}/s`);
  put("cycles", rates.cycles_per_s === null ? "–" : `${rates.cycles_per_s.toFixed(1)}/s`);
  put("latency", rates.latency_p99_us === null ? "–" : `${(rates.latency_p99_us / 1000).toFixed(1)} ms`);
}

// -- The map

function onMap(counts) {
  const from = counts.map((count, k) => count - map.centre[k]);
  return map.axes.map((axis) => axis.reduce((sum, a, k) => sum + a * from[k], 0));
}

function drawMap() {
  show("map-panel", map);
  if (!map) return;
  const { context, width, height, scale } = sized($("map"));
  const all = [...map.covered, ...map.uncovered, ...map.references];
  const reach = [0, 1].map((k) => Math.max(20, ...all.map((point) => Math.abs(point[k]))));
  const size = Math.min((width / 2 - 8 * scale) / reach[0], (height / 2 - 8 * scale) / reach[1]);
  const at = ([u, v]) => [width / 2 + u * size, height / 2 - v * size];
  const dot = (point, radius, fill) => {
    context.beginPath();
    context.arc(...at(point), radius * scale, 0, 2 * Math.PI);
    fill ? context.fill() : context.stroke();
  };
  context.fillStyle = "#009E73";
  for (const point of map.covered) dot(point, 1.9, true);
  context.strokeStyle = "#E69F00";
  context.lineWidth = 1.4 * scale;
  for (const point of map.uncovered) dot(point, 2.6, false);
  context.font = `600 ${10 * scale}px system-ui, sans-serif`;
  context.textAlign = "center";
  context.textBaseline = "middle";
  map.references.forEach((point, k) => {
    const [x, y] = at(point);
    context.save();
    context.translate(x, y);
    context.rotate(Math.PI / 4);
    context.fillStyle = "#CC79A7";
    context.fillRect(-6.5 * scale, -6.5 * scale, 13 * scale, 13 * scale);
    context.restore();
    context.fillStyle = "#14181d";
    context.fillText(String(k + 1), x, y);
  });
  const counts = picture?.gripper?.axes.map((axis) => axis.reached);
  if (counts?.length === map.centre.length && counts.every((count) => count !== null)) {
    context.fillStyle = style("--text");
    context.strokeStyle = style("--back");
    context.lineWidth = 2 * scale;
    dot(onMap(counts), 6, true);
    dot(onMap(counts), 6, false);
  }
  put("map-words", map.words);
}

// -- Teaching, and guided sessions

function teach() {
  const teach = picture.teach;
  show("teach", teach);
  if (!teach) return;
  put("teach-name", `teaching: pose ${teach.round} of ${teach.rounds}`);
  put("teach-words", teach.words);
  put("teach-said", teach.said ?? "");
  put("teach-refused", teach.refused ?? "");
  document.querySelector("#ring .done").style.strokeDasharray = `${100 * Math.max(0, Math.min(1, teach.held))} 100`;
  put("countdown", teach.countdown === null ? "" : String(teach.countdown));
}

function guide() {
  const guide = picture.guide;
  show("guide", guide);
  if (!guide) return;
  const left = guide.left_s > 0 ? `, ${Math.ceil(guide.left_s)} s` : "";
  put("guide-name", `${guide.part} of ${guide.parts}: ${guide.name}${left}`);
  put("guide-words", guide.turning ? `${guide.words} Now: ${guide.turning}.` : guide.words);
  $("guide-left").style.width = `${100 * guide.left}%`;
  $("guide-left").classList.toggle("counts", guide.counts);
  put("guide-drawing", guide.drawing);
  const bends = guide.end.length ? [] : guide.bends_deg.map((bend, finger) => `${NAMES[finger]} ${Math.round(bend)}°`);
  put("guide-bends", bends.length ? `bent by, at the tip: ${bends.join(", ")}` : "");
  list("guide-remarks", guide.end.length ? guide.end : guide.remarks);
}

function faults() {
  const well = !picture.faults.length;
  list("faults", well ? ["nothing: all is well"] : picture.faults);
  $("faults").firstElementChild.classList.toggle("well", well);
  const key = JSON.stringify(picture.actions);
  if ($("actions").dataset.key === key) return;
  $("actions").dataset.key = key;
  $("actions").replaceChildren(
    ...picture.actions.map((action) => {
      const button = Object.assign(document.createElement("button"), { type: "button", textContent: action.words });
      button.addEventListener("click", () => say("do", { what: action.name }));
      return button;
    }),
  );
}

function draw() {
  headline();
  clutchBar();
  if (!picture) return;
  put("title", picture.title);
  put("time", picture.total_s ? `${picture.elapsed_s.toFixed(1)} s of ${picture.total_s.toFixed(0)} s` : `${picture.elapsed_s.toFixed(1)} s`);
  drawHand();
  drawGripper();
  teach();
  guide();
  faults();
  rates();
  drawMap();
}

$("mirror").addEventListener("click", toggleMirror);
$("theme").addEventListener("click", () => setTheme(theme() === "dark" ? "light" : "dark"));
addEventListener("resize", redraw);
const light = matchMedia("(prefers-color-scheme: light)");
light.addEventListener("change", () => setTheme(light.matches ? "light" : "dark"));
setTheme(light.matches ? "light" : "dark");
connect();
