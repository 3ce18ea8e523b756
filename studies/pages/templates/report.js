// The reader's choices: what is compared, where, and how it is looked at; by keyboard and by pointer.

function fillChoices() {
  const values = data.axes[of.compared].values.map((name, value) => [value, name]);
  for (const id of ["a", "b"]) {
    const options = id === "b" || lengths[of.compared] > 1 ? [...values, [TRUTH, "Reference"]] : values;
    byId(id).replaceChildren(...options.map(([value, name]) => make("option", { value }, name)));
    byId(id).value = of[id];
  }
  for (const id of ["rows", "along"].filter(byId)) { // where two things are compared
    const other = id === "rows" ? of.along : of.rows;
    const free = range(lengths.length).filter((axis) => axis !== of.compared && (axis === of[id] || axis !== other));
    const options = free.filter((axis) => lengths[axis] > 1 || axis === of[id]);
    byId(id).replaceChildren(...options.map((axis) => make("option", { value: axis }, data.axes[axis].name)));
    byId(id).value = of[id];
    byId(id).closest("label").hidden = options.length < 2;
  }
}

const choose = (id, then) => byId(id)?.addEventListener("input", (event) => {
  const { value } = event.target;
  of[id] = value === TRUTH ? value : Number(value);
  then?.();
  fillChoices();
  show();
  showComparison();
});
choose("a");
choose("b");
choose("rows");
choose("along");
choose("compared", () => {
  [of.a, of.b] = [0, 1];
  const free = range(lengths.length).filter((axis) => axis !== of.compared).sort((one, other) =>
    (lengths[other] > 1) - (lengths[one] > 1) || (other === LEVEL_AXIS) - (one === LEVEL_AXIS));
  [of.along, of.rows] = free;
});

function moveTo(axis, value) {
  state.place = moved(state.place, axis, value);
  show();
  showComparison();
  fit();
}
byId("level").addEventListener("input", (event) => moveTo(LEVEL_AXIS, Number(event.target.value)));
for (const input of all("[data-axis]")) {
  input.addEventListener("input", () => moveTo(Number(input.dataset.axis), Number(input.value)));
}
for (const id of ["lead-metric", "beside-metric"]) byId(id)?.addEventListener("input", showComparison);
for (const input of all("[name=view], [name=show]")) {
  input.addEventListener("change", () => {
    state[input.name] = input.value;
    state.wipe = input.value === "flip" ? 100 : 50;
    show();
    fit();
  });
}
for (const input of all("[name=metric]")) input.addEventListener("change", showComparison);
for (const [axis, id] of ["row", "column"].entries()) {
  byId(id).addEventListener("input", () => (drawing = drawLoupe()));
  byId(id).addEventListener("change", () => (byId(id).value = clamp(byId(id).value, 0, size()[axis] - 1)));
}

// Wipe, and A or B

function wipeTo(percent) {
  state.wipe = clamp(percent, 0, 100);
  drawWipe();
}
byId("wiper").addEventListener("input", (event) => wipeTo(Number(event.target.value)));
byId("flip").addEventListener("click", () => wipeTo(state.wipe < 50 ? 100 : 0));
document.addEventListener("keydown", (event) => {
  const typing = /^(SELECT|TEXTAREA)$/.test(event.target.tagName) || event.target.type === "number";
  if (event.key.toLowerCase() !== "x" || typing || event.ctrlKey || event.metaKey || event.altKey) return;
  wipeTo(state.wipe < 50 ? 100 : 0);
});

// Zoom: the wheel and a double click enlarge the pictures about the place that they point at.
const stage = byId("stage");
const zoom = { factor: 1, x: 0.5, y: 0.5 };
const inPicture = (event) => {
  const box = stage.getBoundingClientRect();
  const [x, y] = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  return [zoom.x + (x - zoom.x) / zoom.factor, zoom.y + (y - zoom.y) / zoom.factor];
};
function zoomTo(factor, event) {
  if (zoom.factor === 1) [zoom.x, zoom.y] = inPicture(event);
  zoom.factor = Math.min(Math.max(factor, 1), 16);
  stage.style.setProperty("--zoom", zoom.factor);
  stage.style.setProperty("--zoom-at", `${100 * zoom.x}% ${100 * zoom.y}%`);
  stage.style.setProperty("--zoom-x", `${100 * zoom.x}%`);
  stage.toggleAttribute("data-zoomed", zoom.factor > 1);
  drawWipe();
}
stage.addEventListener("wheel", (event) => {
  event.preventDefault();
  zoomTo(zoom.factor * (event.deltaY < 0 ? 1.25 : 0.8), event);
}, { passive: false });
stage.addEventListener("dblclick", (event) => zoomTo(zoom.factor > 1 ? 1 : 4, event));

// The pointer: it carries the loupe, and pressed the wipe.
const point = (event) => {
  const [height, width] = size();
  const [x, y] = inPicture(event);
  byId("column").value = clamp(Math.floor(x * width), 0, width - 1);
  byId("row").value = clamp(Math.floor(y * height), 0, height - 1);
  drawing = drawLoupe();
  if (stage.hasPointerCapture(event.pointerId) && state.view === "wipe") wipeTo(100 * x);
};
stage.addEventListener("pointerdown", (event) => {
  stage.setPointerCapture(event.pointerId);
  point(event);
});
stage.addEventListener("pointermove", point);

for (const link of all("[data-cell]")) {
  link.addEventListener("click", () => {
    let index = Number(link.dataset.cell);
    for (let axis = lengths.length - 1; axis >= 0; axis -= 1) {
      state.place[axis] = index % lengths[axis];
      index = Math.floor(index / lengths[axis]);
    }
    state.place = [...state.place];
    of.a = state.place[of.compared];
    if (of.b === of.a) of.b = TRUTH;
    fillChoices();
    show();
    showComparison();
    fit();
  });
}

// Downloads: all numbers as CSV, and A and B as they are seen, side by side, as PNG.
const save = (name, address) => make("a", { download: name, href: address }).click();
const quoted = (value) => `"${String(value ?? "").replaceAll('"', '""')}"`;
byId("save-csv")?.addEventListener("click", () => {
  const keys = data.metrics.map((metric) => metric.key);
  const head = [...data.axes.map((axis) => axis.name), "luminance_cd_m2", "illuminance_lux", ...keys.flatMap((key) => [key, `${key}_half_interval`])];
  const lines = data.cells.map((cell, index) => {
    let rest = index;
    const place = [...lengths].reverse().map((length) => {
      const at = rest % length;
      rest = Math.floor(rest / length);
      return at;
    }).reverse();
    return [...place.map((at, axis) => data.axes[axis].values[at]), cell.x, cell.lux, ...keys.flatMap((key) => cell.figures[key] ?? ["", ""])];
  });
  const text = [head, ...lines].map((line) => line.map(quoted).join(",")).join("\r\n");
  save("numbers.csv", `data:text/csv;charset=utf-8,${encodeURIComponent(text)}`);
});
byId("save-png")?.addEventListener("click", () => {
  const sides = [byId("over"), byId("under")];
  const [height, width] = [sides[0].height, sides[0].width];
  const canvas = Object.assign(document.createElement("canvas"), { width: 2 * width, height });
  sides.forEach((side, index) => canvas.getContext("2d").drawImage(side, index * width, 0, width, height));
  save("a_and_b.png", canvas.toDataURL("image/png"));
});

// A click elsewhere, or Escape, closes the menu.
const menu = document.querySelector(".menu");
document.addEventListener("pointerdown", (event) => menu.contains(event.target) || (menu.open = false));
document.addEventListener("keydown", (event) => event.key === "Escape" && (menu.open = false));

for (const part of all("[data-script]")) part.hidden = false;
viewOfAddress();
[byId("column").value, byId("row").value] = look;
fillChoices();
show();
showComparison();
fit();
window.addEventListener("resize", () => {
  fit();
  tellScrolls();
});
for (const part of all("details")) part.addEventListener("toggle", tellScrolls);
