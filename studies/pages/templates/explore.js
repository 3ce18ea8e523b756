// The explorer: builds its controls from what the program says of itself, and asks for a picture at every change: one at a
// time, the next with the newest values as soon as the answer is painted, so that pictures follow a slider that moves.
// `render` is what a notebook's widget calls, and the page too.

const CAMERA = ["exposure", "exposure_s", "sensor", "mosaic", "lens", "lens_table", "pixel", "bits", "gain", "iso", "processor", "settings",
  "white_balance", "shot_noise", "seed", "exposure_number", "frames", "row_time_us"];
const TITLES = {
  picture: "Picture", truth: "Reference", raw: "Raw mosaic", noise: "Noise only", "luminance error": "Error of luminance",
  "colour error": "Error of colour, CIEDE2000", flip: "Error as seen, FLIP", snr: "SNR map",
};
const SCALES = {
  truth: "without the sensor's noise", raw: "white: full well",
  noise: "grey: none; black and white: 4 standard deviations", "luminance error": "grey: none; white: +25 % of white",
  "colour error": "dark: 0; yellow: 10 and more", flip: "dark: 0; yellow: 1", snr: "dark: 0 dB; yellow: 40 dB and more",
};
// Slider of a number: from, to, how it runs ("log", "cube" for 0 and small values, "even"), unit.
const LENS = {
  f_number: ["Aperture f/", 0.7, 32, "log", ""], defocus_um: ["Focus, blur disc", 0, 60, "cube", "µm"],
  diffraction: ["Diffraction, 1: ideal lens", 0, 4, "even", "×"], veiling_glare: ["Veiling glare", 0, 0.3, "cube", ""],
};
const PIXEL = {
  read_noise_e: ["Read noise", 0, 300, "cube", "e⁻"], dsnu_e: ["DSNU", 0, 300, "cube", "e⁻"],
  prnu: ["PRNU", 0, 0.2, "cube", ""], dark_current_e_per_s: ["Dark current", 0, 1e5, "cube", "e⁻/s"],
  column_gain_spread: ["Column gains", 0, 0.1, "cube", ""], column_offset_e: ["Column offsets", 0, 100, "cube", "e⁻"],
  hot_pixel_share: ["Hot pixels, share", 0, 0.05, "cube", ""],
  hot_pixel_dark_current_e_per_s: ["Hot pixels, current", 0, 1e6, "cube", "e⁻/s"],
  crosstalk: ["Crosstalk", 0, 0.1, "cube", ""], full_well_e: ["Full well", 100, 1e6, "log", "e⁻"],
};
const SETTINGS = {
  neighbourhood: ["Neighbourhood", 3, 41, "odd", "px"], patch: ["Patch", 1, 9, "odd", "px"],
  sigma_d: ["σ of distance", 0.3, 30, "log", "px"], sigma_s: ["σ of similarity", 0.1, 3000, "log", "noise"],
};
const CHANNELS = { R: "var(--red)", G: "var(--green)", B: "var(--blue)", W: "var(--ink)", C: "var(--blue)", M: "var(--red)", Y: "var(--green)" };
// Filters in the colours that they pass; C is cyan.
const FILTERS = { R: "#d43d33", G: "#2f9e4f", B: "#3b62d6", W: "#f4f4f0", C: "#45b8c4", M: "#b84fa8", Y: "#e3c53a" };
// What each control is; shown where the pointer rests on its name.
const TERMS = {
  scene: "What is photographed. Another one is rendered first; the cameras stay as they are.",
  level: "Mean luminance of the scene, lamps that are seen themselves left out.",
  "level name": "Usual levels of light.",
  reference_light: "Light under which colours of a file or of a scene's own lamps are judged; white in it is white.",
  exposure: "How the exposure time is chosen. auto: the 99th percentile of green at 80 % of the well. auto:W: the same of W. auto:information: the time that leaves the least expected error in the picture. time: as stated.",
  exposure_s: "The time, or the longest that the rule may choose.",
  frames: "Exposures that are merged into one: noise falls with the root of their number, the time rises with it.",
  flicker_depth: "How far the light of all lamps swings about its mean: 0.28 of a fluorescent tube on the mains, 0.95 of a sodium lamp. A rule of exposure then cuts its time to whole periods, if it holds one.",
  flicker_hz: "Twice the mains' frequency: 100 or 120 Hz.",
  row_time_us: "From one row's exposure to the next one's; 0: all rows together. Under lamps that flicker rows that roll show bands.",
  seed: "Of the chip's fixed patterns and of the noise: the same seed makes the same bits.",
  lens_table: "A lens whose point spread by image height, falloff, distortion and lateral colour were traced from a published prescription, at its own f-number; own: the sensor's. Its first picture takes some ten seconds, the next lamp's some three. A distance of focus isn't here, as each is a render of its own: capture --focus-m and studies have it.",
  f_number: "Focal length over the diameter of the aperture: light falls with its square.",
  defocus_um: "Diameter of the disc on the sensor that a point out of focus becomes.",
  diffraction: "Width of a point's image over that of an ideal round aperture; 0: without diffraction.",
  veiling_glare: "Share of the light that scatters evenly over the picture (about ISO 9358's index).",
  sensor: "Pixel, lens and converter to begin with. A .toml file, with the .csv files that it names, can be dropped on the page.",
  mosaic: "Colour filters in front of the pixels; W is none.",
  iso: "Saturation-based speed (ISO 12232) of green: it goes with the gain. An automatic exposure takes the longest time that this leaves room for.",
  gain: "Between pixel and converter: at 1 a full well reads the converter's top, at 8 an eighth of it. What the converter adds falls by it.",
  bits: "Of the analogue-to-digital converter: 2 to that power are its steps.",
  shot_noise: "Light and dark current come as Poisson counts. No camera is without.",
  read_noise_e: "Standard deviation of what reading a dark pixel adds, anew at every exposure.",
  dsnu_e: "Dark signal non-uniformity: standard deviation over pixels of their fixed dark offset.",
  prnu: "Photo-response non-uniformity: standard deviation over pixels of their relative sensitivity; 0.01 is 1 %.",
  dark_current_e_per_s: "Electrons that every pixel collects without light.",
  column_gain_spread: "Standard deviation over columns of their amplifiers' relative gain.",
  column_offset_e: "Standard deviation over columns of their fixed dark offset.",
  hot_pixel_share: "Share of pixels that leak.", hot_pixel_dark_current_e_per_s: "Dark current of the pixels that leak, beside the others'.",
  crosstalk: "Share of a pixel's electrons that each of its four neighbours collects in its place.",
  full_well_e: "Electrons at which a pixel is full.",
  processor: "What makes the picture from the raw image. Slow ones begin when the sliders rest.",
  white_balance: "as-shot: by the scene's light, which the camera is told. gray-world: the mean of the picture is taken for grey.",
  neighbourhood: "Width of the window whose samples are averaged (Ω).", patch: "Width of the patches that are compared; 1: pixels.",
  sigma_d: "Standard deviation of the weight by distance.", sigma_s: "Standard deviation of the weight by similarity, in units of the noise.",
};
const HELP = [
  ["Drag a slider", "The picture follows; its caption states its own settings, the small figure how long it took."],
  ["Views", "Two stand beside one another, under a wipe, or in one place: of camera A or B, or the reference, the render itself."],
  ["Keys", "F flips between the two, E takes another exposure, arrow keys on a picture move the pixel that is measured."],
  ["Sensor", "Drop a sensor's .toml on the page, together with the .csv files that it names. rodcone new preset low_noise -o my.toml writes one."],
  ["Copy Python", "The program that makes this picture or figure again, to the bit."],
  ["Further", "rodcone explore --help; docs/explore.md says what each picture is."],
];
const STEPS = 1000, STALE_MS = 400, REST_MS = 150;

function render({ model, el }) {
  let number = 0, changes = 0, hello, state, edited = "a", cursor = null, stale, rested, shown, pictureSize = [1, 1];
  const page = Math.random().toString(36).slice(2); // a notebook sends every view of a widget all its messages
  const underWay = {}, waiting = {}; // by kind: the request that has no answer yet, and the one to send after it
  let sent = {}; // the last request for pictures: its number, how many changes went before, its sides, when
  const held = []; // the last picture of each view: one that stays as it is comes without bytes
  const root = make("div", { class: "explore" });
  el.append(root);

  // Messages
  // `make` gives the message when it is sent, of the values of that moment.
  function ask(kind, make, then) {
    if (underWay.scene) return; // all is asked anew once it is there
    if (underWay[kind]) { waiting[kind] = [make, then]; return; }
    underWay[kind] = { number: ++number, then };
    model.send({ kind, number, page, ...make(number) });
  }
  // What waits is sent though an older one is under way, which ends there: no answer to it comes, or none that is painted.
  // Of two in a row one is answered, so that pictures come while a slider is moved slowly, too.
  function overtake(kind) {
    const next = waiting[kind];
    if (!next || underWay[kind].overtook) return;
    delete waiting[kind];
    delete underWay[kind];
    ask(kind, ...next);
    underWay[kind].overtook = true;
  }
  model.on("msg:custom", (header, buffers) => {
    if ("page" in header && (header.page === page) === (header.kind === "taken over")) return;
    if (header.kind === "taken over") return status("Another page has taken over; open this one again to take it back.", true);
    if (header.kind === "ended") return status("The program has ended; nothing here is computed any more.", true);
    const kinds = header.number === null ? Object.keys(underWay) : [header.of ?? header.kind]; // null: of no request that it could read
    if (header.kind === "error") fail(header, kinds);
    else if (header.kind === "scene") begin(header, state);
    else if (header.kind === "show") receive(header, buffers); // unasked too: a finer render's, a slow processor's
    else if (underWay[header.kind]?.number === header.number) underWay[header.kind].then?.(header, buffers);
    kinds.filter(kind => header.number === null || underWay[kind]?.number === header.number).forEach(kind => {
      delete underWay[kind];
      const next = waiting[kind];
      delete waiting[kind];
      if (next) ask(kind, ...next);
    });
  });
  ask("hello", () => ({}), header => begin(header));

  // What is asked
  const controls = side => side === "b" ? { ...state.a, ...state.b } : state.a;
  const sides = () => [...new Set(state.views.map(([side]) => side))];
  function change() {
    root.dataset.asked = ++changes;
    clearTimeout(rested);
    rested = setTimeout(() => overtake("show"), REST_MS);
    ask("show", number => {
      sent = { number, changes, sides: sides(), at: performance.now() };
      clearTimeout(stale);
      stale = setTimeout(() => root.classList.add("waiting"), STALE_MS);
      return { cameras: sent.sides.map(controls), views: state.views.map(([side, view]) => [sent.sides.indexOf(side), view]) };
    });
  }
  function fail({ message }, kinds) {
    status(message, true);
    if (kinds.includes("show")) { clearTimeout(stale); root.classList.add("waiting"); root.dataset.failed = sent.changes; }
  }
  function status(text, bad = false) {
    parts.status.textContent = text;
    parts.status.classList.toggle("bad", bad);
  }

  // What is shown
  function receive(header, buffers) {
    buffers.forEach((bytes, index) => { if (bytes.byteLength) held[index] = bytes; });
    if (header.number === sent.number || header.number === shown?.number) paint(header);
  }
  function paint(header) {
    const [height, width] = pictureSize = header.size, newest = header.number === sent.number;
    shown = { ...header, sides: newest ? sent.sides : shown.sides };
    header.views.forEach(([camera, view], index) => {
      parts.captions[index].textContent = caption(header, camera, view, shown.sides[camera]);
      const canvas = parts.canvases[index], bytes = held[index];
      if (canvas.shows === bytes) return;
      canvas.shows = bytes;
      if (canvas.width !== width || canvas.height !== height) {
        Object.assign(canvas, { width, height });
        canvas.style.setProperty("--ratio", width / height);
      }
      const image = new ImageData(width, height), rgba = new Uint32Array(image.data.buffer);
      const rgb = new Uint8Array(bytes.buffer, bytes.byteOffset, bytes.byteLength);
      for (let i = 0, j = 0; i < rgba.length; i++, j += 3) rgba[i] = 0xff000000 | rgb[j + 2] << 16 | rgb[j + 1] << 8 | rgb[j];
      canvas.getContext("2d").putImageData(image, 0, 0);
    });
    clearTimeout(stale);
    root.classList.remove("waiting");
    if (newest) root.dataset.painted = sent.changes;
    root.dataset.last = header.last;
    if (newest && underWay.show) parts.latency.textContent = `${Math.round(performance.now() - sent.at)} ms`;
    const slow = header.cameras.filter(each => each.waiting_for).map(({ waiting_for, controls }) => waiting_for === controls.processor
      ? `${waiting_for} with these settings is at work; the picture is of its default ones. `
      : `${waiting_for} is at work; the picture is ${controls.processor}'s. `);
    parts.cancel.hidden = !slow.length;
    const few = header.last ? "" : `Preview, ${width} × ${height} pixels at ${format(header.spp)} samples; a finer one is being rendered. `;
    status(few + slow.join("")
      + header.notes.join(" "));
    root.dispatchEvent(new CustomEvent("painted", { detail: header, bubbles: true }));
    // after the frame: what they take is not taken from the picture's
    requestAnimationFrame(() => setTimeout(() => { if (root.dataset.painted === root.dataset.asked) refreshFigures(); }));
  }
  function caption(header, camera, view, side) {
    const told = header.cameras[camera].controls, facts = header.facts[camera];
    const name = view === "truth" ? `${TITLES[view]}, ${header.spp ? `${format(header.spp)} samples, render noise ${(100 * header.render_error).toPrecision(2)} %` : "from the file"}` : `${side.toUpperCase()}: ${TITLES[view]}`;
    if (view !== "picture") return `${name}: ${SCALES[view]}`;
    const snr = facts.snr_db === null ? "" : `, green's SNR ${facts.snr_db.toFixed(1)} dB`;
    const speed = facts.iso === null ? `, gain ${Number(facts.gain.toPrecision(3))}` : `, ISO ${Number(facts.iso.toPrecision(3))}`;
    const time = (told.frames > 1 ? `${told.frames} × ` : "") + seconds(facts.exposure_s), full = Number((100 * facts.saturated).toPrecision(2));
    return `${name}: ${told.processor}, ${time}${speed}, ${full} % full${snr}`;
  }

  // Figures follow the picture: asked once it is painted, dim until theirs is there
  const shownCamera = index => [shown.cameras[shown.views[index][0]].controls];
  function refreshFigures() {
    let of;
    parts.figures.classList.add("waiting");
    ask("histogram", () => { of = root.dataset.painted; return { cameras: shownCamera(0) }; }, ({ histogram, python, noise_note }) => {
      figures.histogram = python;
      parts.noise.textContent = noise_note;
      parts.noise.hidden = !noise_note;
      drawHistogram(parts.histogram, histogram);
      parts.figures.classList.toggle("waiting", of !== root.dataset.asked);
      root.dataset.figures = of;
    });
    if (cursor && cursor.row < pictureSize[0] && cursor.column < pictureSize[1]) askPixel();
  }
  function askPixel() {
    ask("pixel", () => ({ cameras: shownCamera(cursor.index), row: cursor.row, column: cursor.column }), ({ pixel, python }) => {
      figures.pixel = python;
      drawPixel(parts.budget, parts.spectrum, pixel);
    });
  }
  function point(index, row, column) {
    const [height, width] = pictureSize;
    cursor = { index, row: clamp(row, 0, height - 1), column: clamp(column, 0, width - 1) };
    if (shown) askPixel();
  }

  // The page
  const parts = { canvases: [], captions: [], selects: [] }, figures = {}; // figures: the Python of each
  function begin(header, before) {
    hello = header;
    const own = structuredClone(header.controls);
    state = { a: own, b: { ...pick(own, CAMERA), mosaic: "bayer", settings: {} },
      views: [["a", "picture"], ["a", "truth"]], ...before };
    if (before) state.a = { ...own, ...pick(before.a, [...CAMERA, "level_cd_m2", "flicker_depth", "flicker_hz"]) };
    [underWay, waiting].forEach(kinds => Object.keys(kinds).forEach(kind => delete kinds[kind]));
    shown = undefined;
    cursor = null;
    parts.status = make("p", { class: "status", role: "status" });
    parts.noise = make("p", { class: "status bad noise", hidden: "" });
    parts.latency = make("small", { class: "latency", title: "From the last change that was sent to its picture" });
    parts.cancel = make("button", { type: "button", hidden: "" }, "Cancel");
    parts.cancel.onclick = () => { ask("cancel", () => ({})); parts.cancel.hidden = true; status("Cancelled: the picture is the quick processor's."); };
    parts.controls = make("form", { class: "controls", "aria-label": "Controls" });
    parts.controls.onsubmit = event => event.preventDefault();
    parts.stage = make("section", { class: "stage", "aria-label": "Pictures" });
    root.replaceChildren(
      make("header", {}, make("h1", {}, "rodcone explore"),
        header.scenes.length ? choice("Scene", header.scenes.map(each => [each, each]), header.title, name => {
          root.classList.add("waiting");
          status(`${name} is being opened.`);
          ask("scene", () => ({ name }));
        }, "scene") : make("span", {}, header.title),
        make("div", { class: "said" }, parts.status, parts.cancel), parts.latency,
        button("Reset", () => begin(hello)), button("Help", () => showDialog("rodcone explore", make("dl", {}, ...HELP.flatMap(([term, text]) => [make("dt", {}, term), make("dd", {}, text)]))))),
      parts.noise,
      make("div", { class: "bench" }, parts.controls, parts.stage));
    buildStage();
    buildControls();
    status(["The first picture is on its way.", ...header.assumed].join(" "));
    change();
  }

  function buildStage() {
    const options = ["a", "b"].flatMap(side => hello.views.filter(view => side === "a" || view !== "truth")
      .map(view => [`${side} ${view}`, view === "truth" ? TITLES.truth : `${side.toUpperCase()}: ${TITLES[view]}`]));
    const figures = [0, 1].map(index => {
      const canvas = make("canvas", { tabindex: "0", "aria-label": `${index ? "Second" : "First"} picture; arrow keys move the pixel that is measured` });
      parts.selects[index] = choice(index ? "Beside" : "View", options, state.views[index].join(" "), value => { state.views[index] = split(value); change(); });
      canvas.onpointermove = canvas.onpointerdown = event => {
        const box = canvas.getBoundingClientRect();
        point(index, Math.floor((event.clientY - box.top) / box.height * pictureSize[0]), Math.floor((event.clientX - box.left) / box.width * pictureSize[1]));
      };
      canvas.onkeydown = event => {
        const step = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] }[event.key];
        if (!step) return;
        event.preventDefault();
        const { row, column } = cursor ?? { row: pictureSize[0] >> 1, column: pictureSize[1] >> 1 };
        point(index, row + step[0], column + step[1]);
      };
      parts.canvases[index] = canvas;
      parts.captions[index] = make("figcaption", {});
      const buttons = make("div", { class: "buttons" },
        button("Copy Python", () => showPython(shown?.python[index])), button("PNG", () => canvas.toBlob(blob => download("explored.png", blob))));
      return make("figure", {}, canvas, parts.captions[index], buttons);
    });
    parts.pictures = make("div", { class: "pictures side" }, ...figures);
    parts.wipe = make("input", { type: "range", min: "0", max: "100", value: "50", "aria-label": "Wipe between the two pictures" });
    parts.wipe.oninput = () => parts.pictures.style.setProperty("--wipe", `${parts.wipe.value}%`);
    parts.wipeRow = make("label", { class: "wipe", hidden: "" }, "Wipe", parts.wipe);
    const layout = choice("Layout", [["side", "Side by side"], ["over", "Wipe"], ["flip", "A/B (F flips)"]], "side", value => {
      parts.pictures.className = `pictures ${value}`;
      parts.wipeRow.hidden = value !== "over";
    });
    parts.histogram = drawing("Histogram of the raw image in electrons");
    parts.budget = make("div", { class: "budget" }, "Point at a pixel.");
    parts.spectrum = drawing("Spectrum of the pixel, and its electrons by channel");
    parts.figures = make("div", { class: "figures" },
      panel("Histogram", parts.histogram, button("Copy Python", () => showPython(figures.histogram))),
      panel("Light budget of the pixel", parts.budget, button("Copy Python", () => showPython(figures.pixel))),
      panel("Its spectrum through the filters", parts.spectrum));
    parts.stage.append(make("div", { class: "bar" }, ...parts.selects, layout, parts.wipeRow), parts.pictures, parts.figures);
    root.addEventListener("keydown", event => {
      if (event.target.matches("input:not([type=range]), select, textarea") || event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.key === "f") parts.pictures.classList.toggle("second");
      if (event.key === "e") another();
    });
  }

  // Controls
  const target = () => edited === "a" ? state.a : state.b;
  const another = () => { target().exposure_number += 1; buildControls(); change(); };
  function buildControls() {
    const camera = target(), preset = hello.sensors[camera.sensor], processors = Object.entries(hello.processors);
    const open = new Set([...parts.controls.querySelectorAll("details[open]")].map(each => each.dataset.name));
    const focused = document.activeElement?.dataset?.key;
    const set = (name, value, rebuild) => { camera[name] = value; if (rebuild) buildControls(); change(); };
    const terms = (name, sliders, own) => Object.entries(own).map(([key, base]) => slider(sliders[key], camera[name][key] ?? base, value => {
      if (value === base) delete camera[name][key]; else camera[name][key] = value;
      change();
    }, `${name}.${key}`, sliders[key][1] === 0));
    const mosaics = [...new Set(processors.flatMap(([, each]) => each.mosaics))];
    const rule = camera.exposure === "time";
    const nameOfLevel = () => Object.entries(hello.levels).find(([, value]) => value === round(state.a.level_cd_m2))?.[0] ?? "";
    const levelName = choice("By name", [["", "–"], ...Object.entries(hello.levels).map(([name, value]) => [name, `${name}, ${format(value)} cd/m²`])], nameOfLevel(), name => {
      if (name) state.a.level_cd_m2 = hello.levels[name];
      buildControls();
      change();
    }, "level name");
    const sensorFile = make("input", { type: "file", accept: ".toml,.csv", multiple: "", hidden: "", "aria-label": "A sensor's .toml file, with the .csv files that it names" });
    sensorFile.onchange = () => takeSensor(sensorFile.files);
    const group = (name, ...children) => {
      const details = make("details", { "data-name": name }, make("summary", {}, name), ...children);
      details.open = parts.controls.children.length ? open.has(name) : true;
      return details;
    };
    // Speed is in proportion to gain: either slider moves the other.
    const gain = slider(["Gain", 1, 64, "log", "×"], camera.iso ? camera.iso / preset.iso : camera.gain ?? preset.gain, value => {
      camera.iso = null;
      iso?.show(round(value * preset.iso));
      set("gain", value === preset.gain ? null : value);
    }, "gain");
    const iso = preset.iso && slider(["ISO", preset.iso, 64 * preset.iso, "log", ""], camera.iso ?? round((camera.gain ?? preset.gain) * preset.iso), value => {
      camera.gain = null;
      gain.show(round(value / preset.iso));
      set("iso", value);
    }, "iso");
    parts.controls.replaceChildren(...[
      group("Light",
        slider(["Level", 1e-4, 1e5, "log", "cd/m²"], state.a.level_cd_m2, value => {
          state.a.level_cd_m2 = value;
          levelName.querySelector("select").value = nameOfLevel();
          change();
        }, "level"),
        levelName,
        slider(["Flicker, depth", 0, 1, "even", ""], state.a.flicker_depth, value => { state.a.flicker_depth = value; change(); }, "flicker_depth", true),
        slider(["Flicker", 10, 1000, "log", "Hz"], state.a.flicker_hz, value => { state.a.flicker_hz = value; change(); }, "flicker_hz"),
        ...Object.entries(hello.groups).flatMap(([name, coloured]) => lamp(name, coloured)),
        Object.values(hello.groups)[0] && choice("Judged under", hello.illuminants.map(each => [each, each]), state.a.reference_light,
          value => { state.a.reference_light = value; change(); }, "reference_light")),
      make("fieldset", { class: "tabs" }, make("legend", {}, "Camera"), ...["a", "b"].map(side => {
        const radio = make("input", { type: "radio", name: "camera", value: side, "data-key": `camera ${side}` });
        radio.checked = edited === side;
        radio.onchange = () => { edited = side; buildControls(); };
        return make("label", {}, radio, `Camera ${side.toUpperCase()}`);
      }), button("A to B", () => { state.b = structuredClone(pick(state.a, CAMERA)); buildControls(); change(); })),
      group("Exposure",
        choice("Rule", hello.rules.map(each => [each, each]), camera.exposure, value => set("exposure", value, true), "exposure"),
        slider([rule ? "Time" : "Longest time", 1e-6, 100, "log", "s"], camera.exposure_s, value => set("exposure_s", value), "exposure_s"),
        ...iso ? [iso] : [],
        slider(["Burst, exposures", 1, 64, "whole", ""], camera.frames, value => set("frames", value), "frames"),
        slider(["Row time", 0, 2000, "cube", "µs"], camera.row_time_us ?? preset.row_time_us, value => set("row_time_us", value === preset.row_time_us ? null : value), "row_time_us", true),
        numberBox("Seed", camera.seed, value => set("seed", value), "seed"),
        make("div", { class: "row" }, button("Another exposure (E)", another), make("small", {}, `number ${camera.exposure_number}`))),
      group("Lens",
        choice("Lens", [["own", "the sensor's own"], ...Object.entries(hello.lenses).map(([name, { text }]) => [name, text])], camera.lens_table, value => {
          hello.lenses[value]?.states.forEach(term => delete camera.lens[term]);
          set("lens_table", value, true);
        }, "lens_table"),
        ...terms("lens", LENS, hello.lenses[camera.lens_table] ? pick(preset.lens, Object.keys(preset.lens).filter(term => !hello.lenses[camera.lens_table].states.includes(term))) : preset.lens)),
      group("Sensor",
        choice("Preset", [...Object.keys(hello.sensors).map(each => [each, each.split(/[\\/]/).pop()]), ["file", "from a file …"]], camera.sensor, value => {
          if (value === "file") { buildControls(); return sensorFile.click(); }
          Object.assign(camera, { lens: {}, pixel: {}, bits: null, gain: null, iso: null, row_time_us: null });
          set("sensor", value, true);
        }, "sensor"),
        sensorFile,
        choice("Mosaic", mosaics.map(each => [each, each]), camera.mosaic, value => {
          if (!hello.processors[camera.processor].mosaics.includes(value)) {
            camera.processor = processors.find(([, each]) => each.mosaics.includes(value))[0];
            camera.settings = {};
          }
          set("mosaic", value, true);
        }, "mosaic"),
        tile(hello.mosaics[camera.mosaic]?.tile ?? preset.tile, hello.mosaics[camera.mosaic]?.text ?? "the sensor's own"),
        gain,
        slider(["Converter", 1, 16, "whole", "bit"], camera.bits ?? preset.bits, value => set("bits", value === preset.bits ? null : value), "bits"),
        checkbox("Shot noise", camera.shot_noise, value => set("shot_noise", value), "shot_noise"),
        ...terms("pixel", PIXEL, preset.pixel)),
      group("Processor",
        choice("Processor", processors.map(([name, each]) => [name, each.slow ? `${name} (slow)` : name]), camera.processor, value => {
          const { mosaics } = hello.processors[value];
          if (!mosaics.includes(camera.mosaic)) camera.mosaic = mosaics[0];
          if ((value === "interleaved_paper") !== (camera.processor === "interleaved_paper")) { // whose method is Gray World
            camera.white_balance = value === "interleaved_paper" ? "gray-world" : hello.controls.white_balance;
          }
          camera.settings = {};
          set("processor", value, true);
        }, "processor"),
        make("small", {}, hello.processors[camera.processor].source),
        choice("White balance", hello.white_balances.map(each => [each, each]), camera.white_balance, value => set("white_balance", value), "white_balance"),
        ...terms("settings", SETTINGS, hello.processors[camera.processor].settings)),
      group("Save",
        make("div", { class: "buttons" },
          button("Raw as DNG", () => ask("dng", () => ({ cameras: [controls(edited)] }), ({ name }, [bytes]) => download(name, new Blob([bytes], { type: "image/x-adobe-dng" })))))),
    ]);
    if (focused) parts.controls.querySelector(`[data-key="${CSS.escape(focused)}"]`)?.focus();
  }
  async function takeSensor(files) {
    const text = Object.fromEntries(await Promise.all([...files].map(async file => [file.name, await file.text()])));
    ask("sensor", () => ({ files: text }), ({ sensor, terms }) => {
      hello.sensors[sensor] = terms;
      Object.assign(target(), { sensor, lens: {}, pixel: {}, bits: null, gain: null, iso: null, row_time_us: null });
      buildControls();
      change();
    });
  }
  root.ondragover = event => event.preventDefault();
  root.ondrop = event => {
    event.preventDefault();
    if (event.dataTransfer.files.length) takeSensor(event.dataTransfer.files);
  };
  function lamp(name, coloured) {
    const own = () => state.a.lamps[name] ??= { spectrum: "own", power: 1, table: [] };
    const now = state.a.lamps[name] ?? { spectrum: "own", power: 1, table: [] };
    const kelvin = /^(\d+)K$/.exec(now.spectrum);
    const value = now.table.length ? "table" : kelvin ? "body" : now.spectrum;
    const options = [["own", "its own"], ["body", "black body"], ...now.table.length ? [["table", `a CSV file's ${now.table.length} points`]] : [],
      ["file", "from a CSV file …"], ...hello.illuminants.map(each => [each, each])];
    const many = Object.keys(hello.groups).length > 1;
    const file = make("input", { type: "file", accept: ".csv,text/csv,text/plain", hidden: "", "aria-label": `CSV file of ${name}'s spectrum` });
    file.onchange = async () => {
      const [table, bad] = tableOf(await file.files[0].text());
      if (bad) return status(`${name}: line ${bad} of ${file.files[0].name} is no wavelength in nm and value; correct it.`, true);
      if (table.length < 2) return status(`${name}: ${file.files[0].name} holds fewer than two rows of wavelength in nm and value.`, true);
      Object.assign(own(), { spectrum: "own", table });
      buildControls();
      change();
    };
    const select = choice(`${name}: spectrum`, options, value, picked => {
      select.querySelector("select").value = value; // until a file is read
      if (picked === "file") file.click();
      if (["file", "table"].includes(picked)) return;
      Object.assign(own(), { spectrum: picked === "body" ? "3000K" : picked, table: [] });
      buildControls();
      change();
    }, `spectrum ${name}`);
    select.querySelector("select").disabled = coloured;
    return [
      select, file,
      kelvin && slider([`${name}: temperature`, 1000, 20000, "log", "K"], +kelvin[1], kelvins => { own().spectrum = `${Math.round(kelvins)}K`; change(); }, `kelvin ${name}`),
      many && slider([`${name}: power`, 0, 64, "cube", "×"], now.power, power => { own().power = power; change(); }, `power ${name}`, true),
    ].filter(Boolean);
  }

  // Saving
  function showPython(text) {
    if (!text) return;
    root.dataset.python = text;
    const area = make("textarea", { readonly: "", rows: "18", cols: "90", "aria-label": "Python" });
    area.value = text;
    showDialog("Python that makes it again, to the bit", area);
    area.select();
    navigator.clipboard?.writeText(text).then(() => status("Copied."), () => status("Copy it from the window: the browser doesn't let the page."));
  }
  function showDialog(title, ...children) {
    const dialog = make("dialog", {}, make("h2", {}, title), ...children, make("form", { method: "dialog" }, make("button", {}, "Close")));
    dialog.onclose = () => dialog.remove();
    root.append(dialog);
    dialog.showModal();
  }
  function download(name, blob) {
    const link = make("a", { href: URL.createObjectURL(blob), download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }
}

// Parts of the page
function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  Object.entries(attributes).forEach(([name, value]) => element.setAttribute(name, value));
  element.append(...children.filter(child => child || child === 0));
  return element;
}
function button(text, act) {
  const element = make("button", { type: "button" }, text);
  element.onclick = act;
  return element;
}
function panel(title, ...children) { return make("section", {}, make("h2", {}, title), ...children); }
function choice(title, options, value, act, key = title) {
  const select = make("select", { "data-key": key }, ...options.map(([name, text]) => make("option", { value: name }, text)));
  select.value = value;
  select.onchange = () => act(select.value);
  return make("label", { class: "choice" }, term(title, key), select);
}
// A mosaic's tile in the colours of its filters, a small one twice across and down, and what it is.
function tile(rows, text) {
  const times = rows.length > 2 || rows[0].length > 2 ? 1 : 2, high = times * rows.length, wide = times * rows[0].length;
  const clear = !/[MY]/.test(rows.join("")); // C beside Y or M is cyan, else clear
  const picture = drawing(`Tile ${rows.join("/")}`);
  picture.setAttribute("viewBox", `0 0 ${wide} ${high}`);
  picture.classList.add("tile");
  for (let y = 0; y < high; y += 1) {
    for (let x = 0; x < wide; x += 1) {
      const letter = rows[y % rows.length][x % rows[0].length];
      add(picture, "rect", { x, y, width: 1, height: 1, fill: FILTERS[letter === "C" && clear ? "W" : letter] ?? "#888888" });
    }
  }
  return make("div", { class: "mosaic" }, picture, make("small", {}, `${rows.join("/")}: ${text}`));
}
function checkbox(title, value, act, key) {
  const box = make("input", { type: "checkbox", "data-key": key });
  box.checked = value;
  box.oninput = () => act(box.checked);
  return make("label", { class: "check" }, box, term(title, key));
}
// Rows of wavelength and value of a CSV, under a line of names or none; or the number of the first line that is no such row.
function tableOf(text) {
  const table = [];
  for (const [index, line] of text.split(/\r?\n/).entries()) {
    const row = line.split(/[,;\t]/).slice(0, 2).map(cell => cell.trim() === "" ? NaN : Number(cell));
    if (row.length === 2 && row.every(Number.isFinite)) table.push(row);
    else if (line.trim() && !line.startsWith("#") && (table.length || index)) return [table, index + 1];
  }
  return [table, 0];
}
function numberBox(title, value, act, key) {
  const box = make("input", { type: "number", min: "0", step: "1", value, "data-key": key });
  box.oninput = () => box.checkValidity() && box.value !== "" && act(Number(box.value));
  return make("label", { class: "choice" }, term(title, key), box);
}
// The name of a control, with its definition where there is one.
function term(title, key) {
  const text = TERMS[key.split(".").pop()];
  return make("span", text ? { class: "term", title: text } : {}, title);
}
// A range beside a number box; both say the same value, the box to the digit.
function slider([title, from, to, way, unit], value, act, key, off = false) {
  const at = {
    log: share => round(from * (to / from) ** share), cube: share => round(from + (to - from) * share ** 3),
    even: share => round(from + (to - from) * share), whole: share => Math.round(from + (to - from) * share),
    odd: share => from + 2 * Math.round((to - from) / 2 * share),
  }[way];
  const place = number => ({
    log: () => Math.log(number / from) / Math.log(to / from), cube: () => Math.cbrt((number - from) / (to - from)),
  }[way] ?? (() => (number - from) / (to - from)))();
  const range = make("input", { type: "range", min: "0", max: STEPS, step: "1", "data-key": key, "aria-label": title });
  const box = make("input", { type: "number", step: "any", value, "data-key": `${key} box`, "aria-label": `${title}${unit ? `, ${unit}` : ""}` });
  const tell = number => range.setAttribute("aria-valuetext", `${format(number)} ${unit}`);
  range.value = STEPS * clamp(place(value), 0, 1);
  tell(value);
  range.oninput = () => { const number = at(range.value / STEPS); box.value = number; tell(number); act(number); };
  box.oninput = () => {
    if (box.value === "" || !Number.isFinite(Number(box.value))) return;
    range.value = STEPS * clamp(place(Number(box.value)), 0, 1) || 0;
    tell(Number(box.value));
    act(Number(box.value));
  };
  const zero = off && button("off", () => { box.value = 0; box.oninput(); });
  const element = make("div", { class: "slider" }, term(title, key), box, make("small", {}, unit), zero, range);
  element.show = number => { box.value = number; range.value = STEPS * clamp(place(number), 0, 1); tell(number); };
  return element;
}
function drawing(title) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  element.setAttribute("viewBox", "0 0 400 200");
  element.setAttribute("role", "img");
  element.setAttribute("aria-label", title);
  return element;
}
function add(svg, tag, attributes, text) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  const { style = "", ...others } = attributes;
  element.style.cssText = style; // as an attribute the page's security policy refuses it
  Object.entries(others).forEach(([name, value]) => element.setAttribute(name, value));
  if (text !== undefined) element.textContent = text;
  svg.append(element);
}
function drawHistogram(svg, { edges_e, counts, well_e, floor_e }) {
  svg.replaceChildren();
  const low = Math.log(edges_e[0]), high = Math.log(edges_e.at(-1));
  const x = electrons => 10 + 380 * (Math.log(Math.max(electrons, edges_e[0])) - low) / (high - low);
  const most = Math.max(...Object.values(counts).flat(), 1), y = count => 165 - 150 * Math.sqrt(count / most);
  for (let decade = 1; decade <= edges_e.at(-1); decade *= 10) {
    add(svg, "line", { x1: x(decade), x2: x(decade), y1: 15, y2: 165, class: "grid" });
    add(svg, "text", { x: x(decade), y: 180, class: "middle" }, decade >= 1e3 ? `${decade / 1e3}k` : decade);
  }
  Object.entries(counts).forEach(([channel, of]) => {
    const points = of.flatMap((count, index) => [[edges_e[index], count], [edges_e[index + 1], count]]).map(([e, count]) => `${x(e).toFixed(1)},${y(count).toFixed(1)}`);
    add(svg, "polyline", { points: points.join(" "), class: "curve", style: `stroke: ${CHANNELS[channel]}` });
    const top = of.indexOf(Math.max(...of));
    add(svg, "text", { x: x(edges_e[top]) - 4, y: y(of[top]) + 8, class: "middle letter", style: `fill: ${CHANNELS[channel]}` }, channel);
  });
  [[well_e, "well", "end"], [floor_e, "noise floor", "start"]].forEach(([e, name, anchor]) => {
    add(svg, "line", { x1: x(e), x2: x(e), y1: 5, y2: 165, class: "mark" });
    add(svg, "text", { x: x(e) + (anchor === "end" ? -3 : 3), y: 12, style: `text-anchor: ${anchor}` }, `${name} ${format(e)}`);
  });
  add(svg, "text", { x: 390, y: 196, style: "text-anchor: end" }, "electrons; samples on a square-root scale");
}
function drawPixel(budget, svg, pixel) {
  const rows = [["Photons on the pixel", format(pixel.photons)],
    ...Object.entries(pixel.electrons).map(([name, value]) => [`Electrons behind ${name}${name === pixel.channel ? ", its own" : ""}`, format(value)]),
    ["Read out", `${format(pixel.read_e)} of ${format(pixel.well_e)}`],
    ...Object.entries(pixel.noise_e).map(([name, value]) => [name === "total" ? "All noise" : `σ of ${name}`, `${format(value)} e⁻`])];
  budget.replaceChildren(make("p", {}, `Row ${pixel.row}, column ${pixel.column}, channel ${pixel.channel}`),
    make("table", {}, ...rows.map(([name, value]) => make("tr", {}, make("th", { scope: "row" }, name), make("td", {}, value)))));
  svg.replaceChildren();
  const nm = pixel.wavelength_nm, x = at => 20 + 370 * (at - nm[0]) / (nm.at(-1) - nm[0] || 1);
  const line = (values, most, attributes) => add(svg, "polyline", { ...attributes, points: values.map((value, index) => `${x(nm[index]).toFixed(1)},${(165 - 150 * value / most).toFixed(1)}`).join(" ") });
  const most = Math.max(...pixel.photons_nm, 1e-30);
  for (let at = 400; at <= nm.at(-1); at += 100) {
    if (at < nm[0]) continue;
    add(svg, "line", { x1: x(at), x2: x(at), y1: 15, y2: 165, class: "grid" });
    add(svg, "text", { x: x(at), y: 180, class: "middle" }, at);
  }
  line(pixel.photons_nm, most, { class: "curve dashed" });
  Object.entries(pixel.electrons_nm).forEach(([channel, values]) => {
    line(values, most, { class: "curve", style: `stroke: ${CHANNELS[channel]}` });
    const top = values.indexOf(Math.max(...values));
    add(svg, "text", { x: x(nm[top]), y: 160 - 150 * values[top] / most, class: "middle letter", style: `fill: ${CHANNELS[channel]}` }, channel);
  });
  add(svg, "text", { x: 390, y: 196, style: "text-anchor: end" }, `nm; dashed: photons, at most ${format(most)} a nm; lines: electrons of each channel`);
}
const round = number => Number(number.toPrecision(4));
const format = number => number === 0 ? "0" : Math.abs(number) >= 1e5 || Math.abs(number) < 1e-3 ? number.toExponential(2) : String(Number(number.toPrecision(4)));
const seconds = time => time >= 1 ? `${format(time)} s` : time >= 1e-3 ? `${format(time * 1e3)} ms` : `${format(time * 1e6)} µs`;
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
const pick = (from, names) => structuredClone(Object.fromEntries(names.map(name => [name, from[name]])));
const split = value => [value.slice(0, 1), value.slice(2)];

export default { render };
