"use strict";
// The viewer: scene and light, level, exposure, sensor, side or wipe, detail. Numbers come ready as text, pictures from
// the overview's images; those that the page leaves out have none.
(() => {
  const byId = (id) => document.getElementById(id);
  const all = (selector, root = document) => [...root.querySelectorAll(selector)];
  const data = JSON.parse(byId("data").textContent);
  const viewer = byId("viewer");
  const figures = all("#side figure");
  const thumbs = new Map(all("[data-cell]").map((link) => [Number(link.dataset.cell), link]));
  const truths = { 0: document.querySelector("[data-truth] img").src };
  for (const image of all("[data-truth-of]")) truths[image.dataset.truthOf] = image.src;
  const LOUPE = [32, 16]; // image pixels
  const state = { view: 0, level: 0, exposure: 0, sensor: 0 };

  // Cells lie in the order of view (scene and light), sensor, exposure, level, camera.
  const view = () => data.views[state.view];
  const group = () => (state.view * data.sensors + state.sensor) * data.exposures.length + state.exposure;
  const cellIndex = (camera) => (group() * view().levels.length + state.level) * data.cameras.length + camera;
  const thumb = (camera) => thumbs.get(cellIndex(Number(camera)))?.querySelector("img").src;
  const source = (camera) => (camera === "truth" ? truths[state.view] : thumb(camera));
  const clamp = (value, low, high) => Math.min(Math.max(Math.round(value) || 0, low), high);

  // A picture that the page leaves out has no source; its place says so.
  function put(image, address) {
    if (address) image.src = address;
    else image.removeAttribute("src");
    image.setAttribute("width", view().width);
    image.setAttribute("height", view().height);
  }

  function showFigure(figure, camera) {
    const cell = data.cells[cellIndex(camera)];
    const image = figure.querySelector("img");
    put(image, source(camera));
    image.parentElement.toggleAttribute("data-absent", !source(camera));
    image.alt = cell.alt;
    const file = cell.file ? `: ${cell.file}` : "";
    figure.querySelector(".gone").textContent = `Not in this page; its numbers are${file}`;
    for (const row of all("[data-row]", figure)) {
      row.querySelector("dd").textContent = cell[row.dataset.row];
      row.hidden = row.dataset.target !== undefined && cell[row.dataset.row] === "—";
      row.classList.toggle("best", cell.best.includes(row.dataset.row));
    }
  }

  function showCondition() {
    const level = view().levels[state.level];
    viewer.style.setProperty("--w", view().width);
    viewer.style.setProperty("--h", view().height);
    if (byId("view")) byId("view").value = state.view;
    byId("level-name").textContent = level.name;
    byId("level-light").textContent = level.light ? `${level.light} · ` : "";
    byId("sensor-name").textContent = data.groups[group()];
    byId("level-source").textContent = level.source;
    byId("level").value = state.level;
    byId("level").setAttribute("aria-valuetext", level.spoken);
    if (byId("exposure")) {
      byId("exposure").value = state.exposure;
      byId("exposure").setAttribute("aria-valuetext", data.exposures[state.exposure]);
    }
    for (const guide of all("[data-guide]")) {
      guide.classList.toggle("current", Number(guide.dataset.guide) === state.level);
    }
  }

  function show() {
    showCondition();
    for (const figure of figures) {
      if (figure.dataset.camera !== undefined) showFigure(figure, Number(figure.dataset.camera));
      else {
        put(figure.querySelector("img"), source("truth"));
        figure.querySelector(".picture").toggleAttribute("data-absent", !source("truth"));
      }
    }
    for (const input of all("[name=sensor]")) input.checked = Number(input.value) === state.sensor;
    for (const [index, link] of thumbs) {
      const here = index - cellIndex(0);
      if (here >= 0 && here < data.cameras.length) link.setAttribute("aria-current", "true");
      else link.removeAttribute("aria-current");
    }
    const said = data.cameras.map((name, camera) => `${name} PSNR ${data.cells[cellIndex(camera)].psnr_db}`);
    byId("status").textContent = `${view().levels[state.level].spoken}, ${data.groups[group()]}: ${said.join(", ")}`;
    showWipe();
    showDetail();
  }

  function showWipe() {
    put(byId("over"), source(byId("left").value));
    put(byId("under"), source(byId("right").value));
    document.querySelector(".stage").toggleAttribute("data-absent", !byId("over").src || !byId("under").src);
    const [left, right] = ["left", "right"].map((id) => byId(id).selectedOptions[0].text);
    byId("over").alt = `${left}, left of the wipe`;
    byId("under").alt = `${right}, right of the wipe`;
    const share = Number(byId("wiper").value);
    byId("wiper").setAttribute("aria-valuetext", `${share} % ${left}, ${100 - share} % ${right}`);
    byId("wipe").style.setProperty("--wipe", `${byId("wiper").value}%`);
  }

  // The same rectangle of every picture, one canvas pixel for each; the style sheet enlarges it without smoothing.
  function showDetail() {
    const { width, height } = view();
    const left = clamp(byId("column").value - LOUPE[0] / 2, 0, Math.max(width - LOUPE[0], 0));
    const top = clamp(byId("row").value - LOUPE[1] / 2, 0, Math.max(height - LOUPE[1], 0));
    for (const figure of figures) {
      const [image, frame, canvas] = ["img", ".frame", ".loupe"].map((name) => figure.querySelector(name));
      const place = { left: left / width, top: top / height, width: LOUPE[0] / width, height: LOUPE[1] / height };
      for (const [name, part] of Object.entries(place)) frame.style[name] = `${100 * part}%`;
      [canvas.width, canvas.height] = LOUPE;
      if (image.src) image.decode().then(() => drawDetail(image, canvas, left, top)).catch(() => {});
    }
  }

  function drawDetail(image, canvas, left, top) {
    canvas.getContext("2d").drawImage(image, left, top, ...LOUPE, 0, 0, ...LOUPE);
  }

  // Whole multiples keep pixels crisp; a picture wider than its column shrinks to fit.
  function fit() {
    const ratio = window.devicePixelRatio || 1;
    const { width, height } = view();
    const wipe = !byId("wipe").hidden;
    const area = wipe ? byId("wipe") : figures[0];
    // A wipe no taller than the window keeps its slider in sight.
    const tall = wipe ? (0.8 * window.innerHeight) / height : Infinity;
    const factorIn = (room) => Math.floor(Math.min(room / width, tall) * ratio);
    const [beside, above] = [false, true].map((top) => {
      viewer.classList.toggle("top", top);
      return factorIn(area.clientWidth);
    });
    viewer.classList.toggle("top", above > beside);
    const factor = Math.max(above, beside);
    viewer.style.setProperty("--shown", `${factor >= 1 ? (factor * width) / ratio : area.clientWidth}px`);
    const scale = factor >= 1 ? `${factor} × ${factor} screen pixels` : "less than a screen pixel";
    byId("scale").textContent = `Each picture is ${width} × ${height} pixels; one of them takes ${scale}.`;
  }

  for (const part of all("[data-script]")) part.hidden = false;
  for (const frame of all(".frame")) frame.hidden = false;

  byId("level").addEventListener("input", (event) => {
    state.level = Number(event.target.value);
    show();
  });
  byId("exposure")?.addEventListener("input", (event) => {
    state.exposure = Number(event.target.value);
    show();
  });
  for (const input of all("[name=sensor]")) {
    input.addEventListener("change", () => {
      state.sensor = Number(input.value);
      show();
    });
  }
  byId("view")?.addEventListener("input", (event) => {
    state.view = Number(event.target.value);
    show();
    fit();
  });
  for (const input of all("[name=metric]")) {
    input.addEventListener("change", () => {
      for (const chart of all("[data-metric]")) {
        if (chart.dataset.metric === input.value) chart.hidden = !input.checked;
      }
    });
  }
  for (const input of all("[name=view]")) {
    input.addEventListener("change", () => {
      byId("side").hidden = input.value !== "side";
      byId("wipe").hidden = input.value !== "wipe";
      document.querySelector(".detail").hidden = input.value !== "side";
      fit();
    });
  }
  for (const id of ["left", "right", "wiper"]) byId(id).addEventListener("input", showWipe);
  for (const id of ["column", "row"]) byId(id).addEventListener("input", showDetail);
  const stage = document.querySelector(".stage");
  const drag = (event) => {
    const box = stage.getBoundingClientRect();
    byId("wiper").value = clamp((100 * (event.clientX - box.left)) / box.width, 0, 100);
    showWipe();
  };
  stage.addEventListener("pointerdown", (event) => {
    stage.setPointerCapture(event.pointerId);
    drag(event);
  });
  stage.addEventListener("pointermove", (event) => stage.hasPointerCapture(event.pointerId) && drag(event));
  for (const figure of figures) {
    const picture = figure.querySelector(".picture");
    const point = (event) => {
      const box = picture.getBoundingClientRect();
      const { width, height } = view();
      byId("column").value = clamp(((event.clientX - box.left) / box.width) * width, 0, width - 1);
      byId("row").value = clamp(((event.clientY - box.top) / box.height) * height, 0, height - 1);
      showDetail();
    };
    picture.addEventListener("pointerdown", point);
    picture.addEventListener("pointermove", (event) => event.pointerType === "mouse" && point(event));
  }
  for (const [index, link] of thumbs) {
    link.addEventListener("click", () => {
      const condition = Math.floor(index / data.cameras.length);
      const chosen = Math.floor(condition / view().levels.length);
      const before = state.view;
      state.view = Math.floor(chosen / (data.exposures.length * data.sensors));
      state.sensor = Math.floor(chosen / data.exposures.length) % data.sensors;
      state.exposure = chosen % data.exposures.length;
      state.level = condition % view().levels.length;
      show();
      if (state.view !== before) fit();
    });
  }
  window.addEventListener("resize", fit);
  show();
  fit();
})();
