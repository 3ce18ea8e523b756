"use strict";
// The viewer: level, exposure, sensor, view and detail. Numbers come ready as text, pictures from the overview's images.
(() => {
  const byId = (id) => document.getElementById(id);
  const all = (selector, root = document) => [...root.querySelectorAll(selector)];
  const data = JSON.parse(byId("data").textContent);
  const viewer = byId("viewer");
  const figures = all("#side figure");
  const thumbs = all("[data-cell]");
  const truth = document.querySelector("[data-truth] img");
  // The attributes: the properties of the same name give the size on the screen.
  const [width, height] = ["width", "height"].map((name) => Number(truth.getAttribute(name)));
  const LOUPE = [32, 16]; // image pixels
  const state = { level: 0, exposure: 0, sensor: 0 };

  // Cells lie in the order of sensor, exposure, level, camera.
  const group = () => state.sensor * data.exposures.length + state.exposure;
  const cellIndex = (camera) => (group() * data.levels.length + state.level) * data.cameras.length + camera;
  const source = (camera) => (camera === "truth" ? truth : thumbs[cellIndex(Number(camera))].querySelector("img")).src;
  const clamp = (value, low, high) => Math.min(Math.max(Math.round(value) || 0, low), high);

  function showFigure(figure, camera) {
    const view = data.cells[cellIndex(camera)];
    const image = figure.querySelector("img");
    image.src = source(camera);
    image.alt = view.alt;
    for (const row of all("[data-row]", figure)) {
      row.querySelector("dd").textContent = view[row.dataset.row];
      row.classList.toggle("best", view.best.includes(row.dataset.row));
    }
  }

  function showCondition() {
    const level = data.levels[state.level];
    byId("level-name").textContent = level.name;
    byId("level-luminance").textContent = level.luminance;
    byId("level-lux").textContent = level.lux;
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
    }
    for (const input of all("[name=sensor]")) input.checked = Number(input.value) === state.sensor;
    for (const thumb of thumbs) {
      const here = Number(thumb.dataset.cell) - cellIndex(0);
      if (here >= 0 && here < data.cameras.length) thumb.setAttribute("aria-current", "true");
      else thumb.removeAttribute("aria-current");
    }
    const said = data.cameras.map((name, camera) => `${name} PSNR ${data.cells[cellIndex(camera)].psnr_db}`);
    byId("status").textContent = `${data.levels[state.level].spoken}, ${data.groups[group()]}: ${said.join(", ")}`;
    showWipe();
    showDetail();
  }

  function showWipe() {
    byId("over").src = source(byId("left").value);
    byId("under").src = source(byId("right").value);
    const [left, right] = ["left", "right"].map((id) => byId(id).selectedOptions[0].text);
    byId("over").alt = `${left}, left of the wipe`;
    byId("under").alt = `${right}, right of the wipe`;
    const share = Number(byId("wiper").value);
    byId("wiper").setAttribute("aria-valuetext", `${share} % ${left}, ${100 - share} % ${right}`);
    byId("wipe").style.setProperty("--wipe", `${byId("wiper").value}%`);
  }

  // The same rectangle of every picture, one canvas pixel for each; the style sheet enlarges it without smoothing.
  function showDetail() {
    const left = clamp(byId("column").value - LOUPE[0] / 2, 0, Math.max(width - LOUPE[0], 0));
    const top = clamp(byId("row").value - LOUPE[1] / 2, 0, Math.max(height - LOUPE[1], 0));
    for (const figure of figures) {
      const [image, frame, canvas] = ["img", ".frame", ".loupe"].map((name) => figure.querySelector(name));
      const place = { left: left / width, top: top / height, width: LOUPE[0] / width, height: LOUPE[1] / height };
      for (const [name, part] of Object.entries(place)) frame.style[name] = `${100 * part}%`;
      image.decode().then(() => drawDetail(image, canvas, left, top)).catch(() => {});
    }
  }

  function drawDetail(image, canvas, left, top) {
    [canvas.width, canvas.height] = LOUPE;
    canvas.getContext("2d").drawImage(image, left, top, ...LOUPE, 0, 0, ...LOUPE);
  }

  // Whole multiples keep pixels crisp; a picture wider than its column shrinks to fit.
  function fit() {
    const ratio = window.devicePixelRatio || 1;
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
      byId("column").value = clamp(((event.clientX - box.left) / box.width) * width, 0, width - 1);
      byId("row").value = clamp(((event.clientY - box.top) / box.height) * height, 0, height - 1);
      showDetail();
    };
    picture.addEventListener("pointerdown", point);
    picture.addEventListener("pointermove", (event) => event.pointerType === "mouse" && point(event));
  }
  for (const thumb of thumbs) {
    thumb.addEventListener("click", () => {
      const condition = Math.floor(Number(thumb.dataset.cell) / data.cameras.length);
      const chosen = Math.floor(condition / data.levels.length);
      state.sensor = Math.floor(chosen / data.exposures.length);
      state.exposure = chosen % data.exposures.length;
      state.level = condition % data.levels.length;
      show();
    });
  }
  window.addEventListener("resize", fit);
  show();
  fit();
})();
