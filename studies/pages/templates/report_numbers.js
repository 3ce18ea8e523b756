"use strict";
// What the page's data says of a cell and of any two: every figure, interval and verdict is the program's own.
const data = JSON.parse(document.getElementById("data").textContent);
const lengths = data.axes.map((axis) => axis.values.length);
const [BALANCE_AXIS, LEVEL_AXIS] = [4, 5];
const MARKS = { ahead: "▲", level: "=", behind: "▼", unknown: "?" };
const OUTCOMES = Object.fromEntries(Object.keys(MARKS).map((name) => [name[0], name]));
const OPPOSITE = { ahead: "behind", behind: "ahead", level: "level", unknown: "unknown" };

// Index of a cell from its place along each axis, in the order of data.axes, and such a place changed along one axis;
// index of a place among those of all axes but some.
const cellAt = (place) => place.reduce((index, at, axis) => index * lengths[axis] + at, 0);
const moved = (place, axis, at) => place.map((before, index) => (index === axis ? at : before));
const indexBut = (place, ...left) =>
  place.reduce((index, at, axis) => (left.includes(axis) ? index : index * lengths[axis] + at), 0);
const range = (count) => [...Array(count).keys()];

// Mean over seeds of a cell's figure, and half of its interval; null where it is unknown.
const figureOf = (metric, cell) => data.cells[cell].figures[metric.key] ?? null;

// What was found of value `a` beside value `b` of an axis: by `i j` with i < j, seen from `a`.
function pairOf(found, a, b, metric) {
  const one = found[a < b ? `${a} ${b}` : `${b} ${a}`]?.[metric.key];
  return one && { one, sign: a < b ? 1 : -1 };
}

// How value `a` does beside value `b` of the axis compared, at the index of a place but for that axis.
function verdictAt(found, a, b, metric, index) {
  const pair = pairOf(found, a, b, metric);
  const lead = pair?.one[1][index] ?? null;
  if (lead === null) return { outcome: "unknown", lead: null, half: null };
  const outcome = OUTCOMES[pair.one[0][index]];
  return { outcome: pair.sign > 0 ? outcome : OPPOSITE[outcome], lead: pair.sign * lead, half: pair.one[2][index] };
}
const verdict = (metric, of, place, b = of.b) =>
  verdictAt(data.comparisons[of.compared].leads, of.a, b, metric, indexBut(place, of.compared));

// A number with so many decimals; a zero has no sign, and with `plus` a larger one has its own.
function fixed(value, digits, plus = false) {
  if (value === null || value === undefined) return "—";
  const text = Math.abs(value).toFixed(digits);
  const sign = Number(text) === 0 ? "" : value < 0 ? "−" : plus ? "+" : "";
  return sign + text;
}

const leadText = (metric, lead) => fixed(lead, metric.digits, true);

function figureText(metric, cell) {
  const found = figureOf(metric, cell);
  if (!found) return "—";
  const half = found[1] === null ? "" : ` ± ${fixed(found[1], metric.digits)}`;
  return `${fixed(found[0], metric.digits)}${half}${metric.unit ? ` ${metric.unit}` : ""}`;
}
