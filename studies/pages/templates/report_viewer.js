// The viewer: what is compared, the condition, wipe, A or B, side by side, error maps and the loupe.
const byId = (id) => document.getElementById(id);
const all = (selector, root = document) => [...root.querySelectorAll(selector)];
const clamp = (value, low, high) => Math.min(Math.max(Math.round(value) || 0, low), high);
const LOUPE = [32, 16]; // image pixels
const TRUTH = "truth";
const KEPT = 24; // pictures that stay decoded
const { level: firstLevel, look, ...firstComparison } = data.first;
const of = firstComparison; // which axes are compared, along and rows, and the two values a and b
if (of.a === of.b) of.b = TRUTH; // nothing competes
const state = { place: moved(lengths.map(() => 0), LEVEL_AXIS, firstLevel), view: "wipe", show: "picture", wipe: 50 };
let drawing = Promise.resolve(); // the last drawing of the viewer, for who waits for it

const valueName = (value) => (value === TRUTH ? data.references[state.place[0]] : data.axes[of.compared].values[value]);
const sceneAndLight = (place) => place[0] * lengths[1] + place[1];
const placeOf = (value) => (value === TRUTH ? state.place : moved(state.place, of.compared, value));
const size = () => data.sizes[placeOf(of.a)[0]];

// Pictures, decoded once; without pixels where the browser doesn't let a page read files beside it.

const decoded = new Map();
function decode(address) {
  if (!decoded.has(address)) decoded.set(address, decodeNow(address));
  if (decoded.size > KEPT) decoded.delete(decoded.keys().next().value);
  return decoded.get(address);
}

async function decodeNow(address) {
  const image = Object.assign(new Image(), { src: address });
  await image.decode();
  const canvas = Object.assign(document.createElement("canvas"), { width: image.width, height: image.height });
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  try {
    return { canvas, pixels: context.getImageData(0, 0, image.width, image.height).data };
  } catch {
    return { canvas, pixels: null };
  }
}

const truthOf = (place) => document.querySelector(`[data-truth="${sceneAndLight(place)}"]`)?.src;

function addressOf(value) {
  if (value === TRUTH) return truthOf(state.place);
  const cell = cellAt(placeOf(value));
  return document.querySelector(`[data-cell="${cell}"] img`)?.src ?? data.cells[cell].file;
}

// Errors of each pixel of a picture against its own truth; null where they can't be had.
const errors = new Map();
async function errorsOf(value, kind) {
  if (value === TRUTH) return null;
  const cell = cellAt(placeOf(value));
  const key = `${kind} ${cell}`;
  if (!errors.has(key)) {
    let found = null;
    if (kind === "flip" && data.flip[cell]) {
      const { pixels } = await decode(data.flip[cell]);
      found = new Float32Array(pixels.length / 4).map((_, at) => pixels[4 * at] / 255);
    } else if (kind === "delta_e" && addressOf(value) && truthOf(placeOf(value))) {
      const [picture, truth] = await Promise.all([decode(addressOf(value)), decode(truthOf(placeOf(value)))]);
      if (picture.pixels && truth.pixels) found = deltaEMap(picture.pixels, truth.pixels);
    }
    errors.set(key, found);
    if (errors.size > KEPT) errors.delete(errors.keys().next().value);
  }
  return errors.get(key);
}

// What stands for A, B or the truth now: the picture, or its error in colours. Without a canvas it says why.
async function shownOf(value) {
  const address = addressOf(value);
  if (!address) return { told: "This picture is not made yet" };
  const picture = await decode(address).catch(() => null);
  if (!picture) return { told: `Not in this page, and its file isn't beside it: ${address}` };
  if (state.show === "picture" || value === TRUTH) return picture;
  const found = await errorsOf(value, state.show);
  if (found) return { canvas: heatCanvas(found, MAP_TOP[state.show], picture.canvas.width, picture.canvas.height) };
  return { told: "Error maps are of the pictures within the page; rodcone report --pictures N puts more into it" };
}

function draw(canvas, { canvas: source, told }) {
  canvas.hidden = !source;
  if (!source) return told;
  [canvas.width, canvas.height] = [source.width, source.height];
  canvas.getContext("2d").drawImage(source, 0, 0);
  return "";
}

// The two pictures, the truth, all of them side by side, and what is written beneath.

async function drawPictures() {
  const now = [of.a, of.b, TRUTH];
  const asked = JSON.stringify([state, of]);
  const found = await Promise.all(now.map(shownOf));
  if (asked !== JSON.stringify([state, of])) return; // the reader went on meanwhile
  const told = [draw(byId("over"), found[0]), draw(byId("under"), found[1])];
  byId("gone").textContent = told.filter(Boolean).join(". ");
  byId("gone").hidden = !byId("gone").textContent;
  ["A", "B", "T"].forEach((name, index) => (byId(`loupe-${name}`).source = found[index].canvas));
  if (state.view === "side") await drawSide();
  await drawLoupe();
}

async function drawSide() {
  const values = [...range(lengths[of.compared]), TRUTH];
  const shown = await Promise.all(values.map(shownOf));
  byId("side").style.setProperty("--across", Math.min(values.length, 6)); // the reference in the row of the others
  byId("side").replaceChildren(...values.map((value, index) => {
    const canvas = make("canvas", { role: "img", "aria-label": valueName(value) });
    const told = draw(canvas, shown[index]);
    return make("figure", {}, make("figcaption", {}, valueName(value)), canvas, ...(told ? [make("p", {}, told)] : []));
  }));
}

// The same rectangle of A, B and the truth, one canvas pixel for each, and the values of the pixel in its middle.
async function drawLoupe() {
  const [height, width] = size();
  const [column, row] = [byId("column"), byId("row")].map((input) => Number(input.value));
  const left = clamp(column - LOUPE[0] / 2, 0, Math.max(width - LOUPE[0], 0));
  const top = clamp(row - LOUPE[1] / 2, 0, Math.max(height - LOUPE[1], 0));
  const part = { left: left / width, top: top / height, width: LOUPE[0] / width, height: LOUPE[1] / height };
  for (const [name, share] of Object.entries(part)) byId("frame").style[name] = `${100 * share}%`;
  const at = clamp(row, 0, height - 1) * width + clamp(column, 0, width - 1);
  const three = [["A", of.a], ["B", of.b], ["T", TRUTH]];
  for (const [name] of three) { // all of them before the first error map is awaited
    const canvas = byId(`loupe-${name}`);
    [canvas.width, canvas.height] = LOUPE;
    if (canvas.source) canvas.getContext("2d").drawImage(canvas.source, left, top, ...LOUPE, 0, 0, ...LOUPE);
  }
  for (const [name, value] of three) byId(`pixel-${name}`).textContent = await pixelText(value, at);
}

async function pixelText(value, at) {
  const picture = addressOf(value) ? await decode(addressOf(value)).catch(() => null) : null;
  if (!picture?.pixels) return "not readable here";
  const text = `sRGB ${[...picture.pixels.slice(4 * at, 4 * at + 3)].join(" ")}`;
  const [colour, flip] = [await errorsOf(value, "delta_e"), await errorsOf(value, "flip")];
  return text + (colour ? ` · ΔE2000 ${fixed(colour[at], 1)}` : "") + (flip ? ` · FLIP ${fixed(flip[at], 2)}` : "");
}

const FACTS = { exposure: "Exposure", saturated: "Saturated", mc_share: "Render's noise", substitution: "W as luminance",
  balance: "White balance" };

function drawNumbers() {
  const cells = [of.a, of.b].map((value) => (value === TRUTH ? null : cellAt(placeOf(value))));
  const lines = data.metrics.filter((metric) => cells.some((cell) => cell !== null && figureOf(metric, cell)))
    .map((metric) => make("tr", {}, metricHead(metric),
      ...cells.map((cell) => make("td", { class: "n" }, cell === null ? "—" : figureText({ ...metric, unit: "" }, cell))),
      verdictCell(metric, cells.includes(null) || of.a === of.b ? { outcome: "unknown", lead: null } : verdict(metric, of, state.place))));
  const told = ([key]) => cells.some((cell) => cell !== null && data.cells[cell][key]);
  const facts = Object.entries(FACTS).filter(told).map(([key, name]) => make("tr", { class: "fact" }, make("th", { scope: "row" }, name),
    ...cells.map((cell) => make("td", { class: "n" }, cell === null ? "—" : data.cells[cell][key] || "—")), make("td", {})));
  byId("numbers").replaceChildren(...lines, ...facts);
}

function drawWipe() {
  byId("stage").style.setProperty("--wipe", `${state.wipe}%`);
  byId("wiper").value = state.wipe;
  const [a, b] = [of.a, of.b].map(valueName);
  byId("wiper").setAttribute("aria-valuetext", `${state.wipe} % ${a}, ${100 - state.wipe} % ${b}`);
  byId("flip").textContent = `Show ${state.wipe < 50 ? "A" : "B"} (key x)`;
  byId("tag-A").hidden = state.wipe < 8;
  byId("tag-B").hidden = state.wipe > 92;
}

// Words and controls of the condition; pictures and charts follow.
function show() {
  const [height, width] = size();
  const level = data.levels[sceneAndLight(state.place)][state.place[LEVEL_AXIS]];
  byId("viewer").style.setProperty("--w", width);
  byId("viewer").style.setProperty("--h", height);
  const levels = of.compared === LEVEL_AXIS; // then A and B are two of them
  byId("level-name").textContent = levels ? [of.a, of.b].map(valueName).join(" beside ") : level.name;
  byId("level-light").textContent = levels ? "" : [level.light, level.source].filter(Boolean).join(" · ");
  byId("level").value = state.place[LEVEL_AXIS];
  byId("level").setAttribute("aria-valuetext", level.spoken);
  for (const [name, value] of [["A", of.a], ["B", of.b], ["T", TRUTH]]) {
    all(`[data-name="${name}"]`).forEach((place) => (place.textContent = valueName(value)));
  }
  for (const input of all("[data-axis]")) {
    const at = state.place[input.dataset.axis];
    if (input.type === "radio") input.checked = Number(input.value) === at;
    else input.value = at;
    input.closest("label").hidden = Number(input.dataset.axis) === of.compared;
  }
  for (const fixed of all(".fixed")) fixed.hidden = !all("label", fixed).some((label) => !label.hidden);
  byId("level").closest(".slider").hidden = lengths[LEVEL_AXIS] < 2 || of.compared === LEVEL_AXIS;
  byId("side").hidden = state.view !== "side";
  byId("pair").hidden = state.view === "side";
  byId("wipe-control").hidden = state.view !== "wipe";
  byId("key").hidden = state.show === "picture";
  byId("key-top").textContent = `${MAP_TOP[state.show]} and more`;
  for (const link of all("[data-cell]")) {
    const here = [of.a, of.b].some((value) => value !== TRUTH && cellAt(placeOf(value)) === Number(link.dataset.cell));
    link.toggleAttribute("aria-current", here);
  }
  const psnr = data.metrics.find((metric) => metric.key === "psnr_db");
  const said = [of.a, of.b].filter((value) => value !== TRUTH).map((value) => `${valueName(value)} ${
    psnr ? `PSNR ${figureText(psnr, cellAt(placeOf(value)))}` : ""}`);
  byId("status").textContent = `${level.spoken}: ${said.join(", ")}`;
  drawWipe();
  drawNumbers();
  drawing = drawPictures();
  keepAddress();
}

// The address holds the view, so that it can be sent: what is compared, where, and how it is looked at.
function keepAddress() {
  const view = new URLSearchParams({ axis: of.compared, a: of.a, b: of.b, place: state.place.join("."), view: state.view, show: state.show });
  try {
    history.replaceState(null, "", `#${view}`);
  } catch { /* a page without an address of its own, as in a preview, goes on without */ }
}

function viewOfAddress() {
  const asked = new URLSearchParams(location.hash.slice(1));
  if (!asked.has("place")) return;
  const place = asked.get("place").split(".").map(Number);
  const axis = Number(asked.get("axis"));
  const valueOf = (name) => (asked.get(name) === TRUTH ? TRUTH : Number(asked.get(name)));
  const allowed = (value) => value === TRUTH || (Number.isInteger(value) && value >= 0 && value < lengths[axis]);
  const inside = place.length === lengths.length && place.every((at, index) => Number.isInteger(at) && at >= 0 && at < lengths[index]);
  if (!inside || !(axis in lengths) || ![valueOf("a"), valueOf("b")].every(allowed)) return;
  state.place = place;
  const free = range(lengths.length).filter((other) => other !== axis).sort((one, other) =>
    (lengths[other] > 1) - (lengths[one] > 1) || (other === LEVEL_AXIS) - (one === LEVEL_AXIS));
  if (axis !== of.compared) [of.along, of.rows] = free;
  Object.assign(of, { compared: axis, a: valueOf("a"), b: valueOf("b") });
  for (const name of ["view", "show"]) {
    const input = document.querySelector(`[name="${name}"][value="${CSS.escape(asked.get(name) ?? "")}"]`);
    if (input) [input.checked, state[name]] = [true, input.value];
  }
  if (byId("compared")) byId("compared").value = axis;
}

function showComparison() {
  const pair = of.b !== TRUTH && of.a !== of.b;
  byId("verdicts")?.replaceChildren(...(pair ? drawTables(of, state.place) : []));
  const metricOf = (id) => data.metrics.find((metric) => metric.key === byId(id)?.value);
  const rivals = of.a !== TRUTH && Object.keys(data.comparisons[of.compared].counts).length;
  byId("beside")?.replaceChildren(...(rivals ? [drawBeside(of, metricOf("beside-metric"))] : []));
  byId("lead-chart")?.replaceChildren(...(pair ? [drawLead(of, state.place, metricOf("lead-metric"))] : []));
  showAnswer();
  const chosen = new Set(all("[name=metric]:checked").map((input) => input.value));
  byId("drawn").replaceChildren(...drawCharts(of, state.place, chosen));
  tellScrolls();
}

// The words of the headline for A and B in this place.
function showAnswer() {
  if (!byId("said")) return;
  const group = indexBut(state.place, of.compared, LEVEL_AXIS);
  const { answers } = data.comparisons[of.compared];
  const answer = answers[`${of.a} ${of.b}`]?.[group];
  byId("place").textContent = data.groups[of.compared][group] ?? "";
  byId("said").textContent = answer?.said ?? "";
  byId("light").textContent = answer?.light ?? "";
  byId("balance").textContent = answer?.balance ?? "";
  byId("times").textContent = answer?.times ?? "";
}

// Whole multiples keep pixels crisp; a picture wider than its place shrinks to fit.
function fit() {
  const ratio = window.devicePixelRatio || 1;
  const [height, width] = size();
  const room = byId("pair").clientWidth || byId("viewer").clientWidth;
  const beside = getComputedStyle(byId("pair")).gridTemplateColumns.split(" ").length > 1 ? room - 400 : room;
  const tall = Math.max(0.86 * window.innerHeight, 512 * (height / width));
  const factor = Math.floor(Math.min(beside / width, tall / height) * ratio);
  // On a phone the picture is as wide as the screen, even where that is no whole multiple.
  const whole = (factor * width) / ratio;
  const shown = beside < 512 || whole === 0 ? beside : whole;
  byId("viewer").style.setProperty("--shown", `${shown}px`);
  byId("scale").textContent = `${width} × ${height} pixels, shown × ${fixed((shown * ratio) / width, shown === whole ? 0 : 1)}`;
}

// Tables that are wider than their place say so.
function tellScrolls() {
  for (const place of all(".scroll")) place.toggleAttribute("data-scrolls", place.scrollWidth > place.clientWidth + 1);
}
