// The summary's tables and the charts, drawn anew for whatever is compared.
const LETTER = 6; // width of a tick's letter, in the chart's units
const WIDTH = 300, HEIGHT = 190, LEFT = 44, RIGHT = 288, TOP = 10, BOTTOM = 154;
const DRAWING = document.querySelector("svg").namespaceURI;

function make(name, attributes = {}, ...children) {
  const drawn = "svg g path text line title circle rect".split(" ").includes(name);
  const made = drawn ? document.createElementNS(DRAWING, name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

function verdictCell(metric, { outcome, lead }) {
  const cell = make("td", { class: `n ${outcome}` });
  if (lead === null) cell.append("—");
  else {
    const mark = make("i", { "aria-hidden": "true" }, MARKS[outcome]);
    cell.append(make("span", { class: "sr" }, `${outcome}, `), mark, ` ${leadText(metric, lead)}`);
  }
  return cell;
}

function metricHead(metric) {
  return make("th", { scope: "row" }, metric.name, ...(metric.unit ? [" ", make("small", {}, metric.unit)] : []));
}

// One table a row of the comparison: metrics down, light (or what else lies along) across.
function drawTables(of, place) {
  const head = data.axes[of.along].values.map((name) => make("th", { scope: "col", class: "n" }, name));
  return range(lengths[of.rows]).map((row) => {
    const at = moved(place, of.rows, row);
    const lines = data.metrics.map((metric) => {
      const cells = range(lengths[of.along]).map((step) => {
        const here = moved(at, of.along, step);
        return verdictCell(metric, verdict(metric, of, here));
      });
      return make("tr", {}, metricHead(metric), ...cells);
    });
    const title = data.axes[of.rows].values[row];
    const table = make("table", { class: "cells verdicts" },
      make("thead", {}, make("tr", {}, make("th", { scope: "col" }, title), ...head.map((cell) => cell.cloneNode(true)))),
      make("tbody", {}, ...lines));
    return make("div", { class: "scroll", role: "region", tabindex: "0", "aria-label": `Summary, ${title}` }, table);
  });
}

// A's lead over each other value of the axis in one metric: places down, light across; means over scenes; counts.
function drawBeside(of, metric) {
  const { leads, means, counts } = data.comparisons[of.compared];
  const levels = data.axes[LEVEL_AXIS].values;
  const rows = range(lengths[of.compared]).filter((value) => value !== of.a).flatMap((other) => {
    const line = (title, verdictOf) => make("tr", { class: other === of.b ? "chosen" : "" },
      make("th", { scope: "row" }, [data.axes[of.compared].values[other], title].filter(Boolean).join(", ")),
      ...levels.map((_, step) => verdictCell(metric, verdictOf(step))));
    const lines = data.groups[of.compared].map((title, group) => line(title, (step) =>
      verdictAt(leads, of.a, other, metric, withLevel(group, step, of.compared))));
    const key = of.a < other ? `${of.a} ${other}` : `${other} ${of.a}`;
    for (const mean of means[key]) lines.push(line(mean.title, (step) => verdictAt({ [key]: mean }, of.a, other, metric, step)));
    const counted = pairOf(counts, of.a, other, metric);
    const three = counted.sign > 0 ? counted.one : [...counted.one].reverse();
    lines[0].append(make("td", { rowspan: lines.length, class: "n" }, three.join(" / ")));
    return lines;
  });
  const head = ["beside", ...levels, "ahead / level / behind"];
  return make("table", { class: "cells verdicts" },
    make("thead", {}, make("tr", {}, ...head.map((name) => make("th", { scope: "col" }, name)))), make("tbody", {}, ...rows));
}

// Index of a group at a light level, among the places but for the axis compared: the level lies before the last axis.
function withLevel(group, step, compared) {
  const last = compared === lengths.length - 1 ? 1 : lengths.at(-1);
  return (Math.floor(group / last) * lengths[LEVEL_AXIS] + step) * last + (group % last);
}

// The lead of A over B along the axis, with its interval, and the band of what nobody sees.
function drawLead(of, place, metric) {
  const found = range(lengths[of.along]).map((step) => verdict(metric, of, moved(place, of.along, step)));
  const ends = found.filter((one) => one.lead !== null).flatMap(({ lead, half }) => [lead - (half ?? 0), lead + (half ?? 0)]);
  if (!ends.length) return "";
  const bounds = [Math.min(...ends, -1.5 * metric.threshold), Math.max(...ends, 1.5 * metric.threshold)];
  const { chart, xs, up } = frameOf(`Lead in ${metric.name}`, of, place, bounds);
  const band = { class: "unseen", x: LEFT, width: RIGHT - LEFT, y: up(metric.threshold), height: up(-metric.threshold) - up(metric.threshold) };
  const words = (step) => `${data.axes[of.along].values[step]}: ${found[step].outcome}, ${leadText(metric, found[step].lead)}`;
  chart.prepend(make("rect", band));
  chart.append(make("line", { class: "axis", x1: LEFT, x2: RIGHT, y1: up(0), y2: up(0) }),
    drawLine(0, xs, found.map((one) => (one.lead === null ? null : [one.lead, one.half])), words, up));
  return chart;
}

// Round steps that enclose low to high, about four of them.
function ticksOf(low, high) {
  const span = high - low || Math.abs(low) || 1;
  const power = 10 ** Math.floor(Math.log10(span / 4));
  const step = power * [1, 2, 2.5, 5, 10].find((factor) => factor * power >= span / 4);
  const first = Math.floor(low / step + 1e-9);
  const count = Math.max(Math.ceil(high / step - 1e-9) - first, 1);
  return range(count + 1).map((index) => Number(((first + index) * step).toPrecision(12)));
}

function markOf(slot, x, y) {
  if (slot % 4 === 0) return make("circle", { cx: x, cy: y, r: 3.6 });
  if (slot % 4 === 1) return make("rect", { x: x - 3.2, y: y - 3.2, width: 6.4, height: 6.4 });
  const path = slot % 4 === 2 ? `M${x} ${y - 4.6}l4.6 7.8h-9.2z` : `M${x} ${y - 5}l5 5l-5 5l-5 -5z`;
  return make("path", { d: path });
}

// Positions along the axis: light on a scale of factors where it is known, else evenly.
function positions(of, place) {
  const steps = range(lengths[of.along]);
  const light = steps.map((step) => data.cells[cellAt(moved(place, of.along, step))][data.light.key]);
  const known = of.along === LEVEL_AXIS && light.every((x) => x > 0);
  const values = known ? light.map(Math.log10) : steps;
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const margin = (high - low || 1) * 0.05;
  const across = (value) => LEFT + ((value - low + margin) / (high - low + 2 * margin)) * (RIGHT - LEFT);
  const whole = range(Math.floor(high) - Math.ceil(low) + 1).map((index) => Math.ceil(low) + index);
  const powers = whole.length > 1 ? whole : values;
  const ticks = known
    ? powers.map((power) => [across(power), String(Number((10 ** power).toPrecision(2)))])
    : steps.map((step) => [across(step), data.axes[of.along].values[step].slice(0, 11)]);
  return { xs: values.map(across), ticks, name: known ? data.light.name : data.axes[of.along].name };
}

// A chart without its lines: ticks of both axes, and where values lie.
function frameOf(title, of, place, bounds) {
  const ticks = ticksOf(...bounds);
  const [low, high] = [ticks[0], ticks.at(-1)];
  const up = (value) => BOTTOM - ((value - low) / (high - low)) * (BOTTOM - TOP);
  const { xs, ticks: across, name } = positions(of, place);
  const chart = make("svg", { class: "chart", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label":
    `${title}, over ${name}. The table of all numbers holds the figures.` });
  if (place[of.along] < xs.length) {
    chart.append(make("line", { class: "guide", x1: xs[place[of.along]], x2: xs[place[of.along]], y1: TOP, y2: BOTTOM }));
  }
  for (const tick of ticks) {
    chart.append(make("line", { class: "grid", x1: LEFT, x2: RIGHT, y1: up(tick), y2: up(tick) }),
      make("text", { class: "tick", x: LEFT - 6, y: up(tick) + 4, "text-anchor": "end" }, String(tick).replace("-", "−")));
  }
  let free = -Infinity; // where the label before ends: one that would be written over it is left out
  for (const [x, text] of across) {
    const half = (LETTER * text.length) / 2;
    if (x - half < free) { continue; }
    chart.append(make("text", { class: "tick", x, y: BOTTOM + 16, "text-anchor": "middle" }, text));
    free = x + half + LETTER;
  }
  chart.append(make("text", { class: "tick", x: RIGHT, y: HEIGHT - 5, "text-anchor": "end" }, name));
  return { chart, xs, up };
}

function drawChart(metric, of, place, bounds) {
  const title = `${metric.name}${metric.unit ? `, ${metric.unit}` : ""}: ${data.axes[of.rows].values[place[of.rows]]}`;
  const { chart, xs, up } = frameOf(title, of, place, bounds);
  for (const slot of range(lengths[of.compared]).reverse()) {
    const cells = xs.map((_, step) => cellAt(moved(moved(place, of.along, step), of.compared, slot)));
    const found = cells.map((cell) => figureOf(metric, cell));
    const words = (step) => `${data.cells[cells[step]].alt}: ${figureText(metric, cells[step])}`;
    chart.append(drawLine(slot, xs, found, words, up));
  }
  return chart;
}

// A line with its band, broken where a figure is unknown.
function drawLine(slot, xs, found, words, up) {
  const line = make("g", { class: `slot${slot % 4} turn${Math.floor(slot / 4)}` });
  let [path, upper, lower] = ["", [], []];
  const endBand = () => {
    if (upper.length) line.append(make("path", { class: "band", d: `M${[...upper, ...lower.reverse()].join("L")}Z` }));
    [upper, lower] = [[], []];
  };
  found.forEach((one, step) => {
    if (!one) return endBand();
    path += `${found[step - 1] ? "L" : "M"}${xs[step]} ${up(one[0])}`;
    if (one[1] === null) return;
    upper.push(`${xs[step]} ${up(one[0] + one[1])}`);
    lower.push(`${xs[step]} ${up(one[0] - one[1])}`);
  });
  endBand();
  line.append(make("path", { class: "line", d: path }));
  found.forEach((one, step) => {
    if (!one) return;
    const mark = make("g", { class: "mark" }, make("title", {}, words(step)), markOf(slot, xs[step], up(one[0])));
    mark.addEventListener("click", () => moveTo(of.along, step)); // a click on a point shows its pictures
    line.append(mark);
  });
  return line;
}

// The legend, and for each row a chart of each metric that is chosen; charts of one metric share their scale.
function drawCharts(of, place, chosen) {
  const legend = make("p", { class: "legend" }, ...data.axes[of.compared].values.map((name, slot) => {
    const line = make("path", { class: "line", d: "M0 6H28" });
    const key = make("svg", { class: `key slot${slot % 4} turn${Math.floor(slot / 4)}`, viewBox: "0 0 28 12",
      width: 28, height: 12, "aria-hidden": "true" }, line, markOf(slot, 14, 6));
    return make("span", {}, key, ` ${name}`);
  }));
  const metrics = data.metrics.filter((metric) => chosen.has(metric.key));
  const shared = new Map(metrics.map((metric) => {
    const ends = range(lengths[of.rows]).flatMap((row) => range(lengths[of.along]).flatMap((step) =>
      range(lengths[of.compared]).flatMap((value) => {
        const at = moved(moved(moved(place, of.rows, row), of.along, step), of.compared, value);
        const found = figureOf(metric, cellAt(at));
        return found ? [found[0] - (found[1] ?? 0), found[0] + (found[1] ?? 0)] : [];
      })));
    return [metric.key, ends.length ? [Math.min(...ends), Math.max(...ends)] : null];
  }));
  const rows = range(lengths[of.rows]).flatMap((row) => {
    const drawn = metrics.filter((metric) => shared.get(metric.key)).map((metric) => {
      const better = make("small", {}, metric.higher ? "higher is better" : "lower is better");
      const caption = make("figcaption", {}, make("b", {}, metric.name), metric.unit ? `, ${metric.unit} ` : " ", better);
      const chart = drawChart(metric, of, moved(place, of.rows, row), shared.get(metric.key));
      return make("figure", { "data-metric": metric.key }, caption, chart);
    });
    const title = lengths[of.rows] > 1 ? [make("h3", {}, data.axes[of.rows].values[row])] : [];
    return [...title, make("div", { class: "charts" }, ...drawn)];
  });
  return [legend, ...rows];
}
