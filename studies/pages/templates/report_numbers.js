"use strict";
// Where a cell lies, its mean and interval over seeds, and which of two pictures is better: the sums of
// studies/pages/report_compare.py, for whatever the reader chooses.
const data = JSON.parse(document.getElementById("data").textContent);
const lengths = data.axes.map((axis) => axis.values.length);
const LEVEL_AXIS = 4;
const MARKS = { ahead: "▲", level: "=", behind: "▼", unknown: "?" };

// Index of a cell from its place along each axis, in the order of data.axes; and such a place changed along one axis.
const cellAt = (place) => place.reduce((index, at, axis) => index * lengths[axis] + at, 0);
const moved = (place, axis, at) => place.map((before, index) => (index === axis ? at : before));
const range = (count) => [...Array(count).keys()];

// Mean over seeds with half of its 95 % interval, by Student's t; one seed has no interval.
function meanOf(values) {
  if (!values?.length) return null;
  const count = values.length;
  const mean = values.reduce((sum, value) => sum + value, 0) / count;
  if (count === 1) return { mean, half: null };
  const variance = values.reduce((sum, value) => sum + (value - mean) ** 2, 0) / (count - 1);
  return { mean, half: data.t * Math.sqrt(variance / count) };
}

// How the first cell does beside the second: mean of each seed's difference, positive where the first is better.
function verdict(metric, cell, other) {
  const [first, second] = [cell, other].map((index) => data.cells[index].values[metric.key]);
  if (!first || !second) return { outcome: "unknown", lead: null };
  const lead = meanOf(first.map((value, seed) => (metric.higher ? 1 : -1) * (value - second[seed])));
  const { mean, half } = lead;
  if (half === null) return { outcome: "unknown", lead: mean };
  return { outcome: mean - half > 0 ? "ahead" : mean + half < 0 ? "behind" : "level", lead: mean };
}

// A number with so many decimals; a zero has no sign, and with `plus` a larger one has its own.
function fixed(value, digits, plus = false) {
  if (value === null || value === undefined) return "—";
  const text = Math.abs(value).toFixed(digits);
  const sign = Number(text) === 0 ? "" : value < 0 ? "−" : plus ? "+" : "";
  return sign + text;
}

// A lead that is clear of 0 has as many decimals, up to three more, as show that it isn't 0.
function leadText(metric, { outcome, lead }) {
  let { digits } = metric;
  const clear = outcome === "ahead" || outcome === "behind";
  while (clear && digits < metric.digits + 3 && Number(Math.abs(lead).toFixed(digits)) === 0) digits += 1;
  return fixed(lead, digits, true);
}

function figureText(metric, cell) {
  const found = meanOf(data.cells[cell].values[metric.key]);
  if (!found) return "—";
  const half = found.half === null ? "" : ` ± ${fixed(found.half, metric.digits)}`;
  return `${fixed(found.mean, metric.digits)}${half}${metric.unit ? ` ${metric.unit}` : ""}`;
}

// All places but for one axis: each with the first value of it.
function placesBut(axis) {
  return range(lengths.reduce((product, length) => product * length, 1) / lengths[axis]).map((index) => {
    const place = [];
    for (let at = lengths.length - 1; at >= 0; at -= 1) {
      const length = at === axis ? 1 : lengths[at];
      place[at] = index % length;
      index = Math.floor(index / length);
    }
    return place;
  });
}
