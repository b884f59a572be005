// Which variants are shown, and in what order: functions of REPORT, without the document.
"use strict";

const COUNT = REPORT.labels.length;

// The values of a column: `p0` a parameter, `mrmse` a measure, "" the order of the sweep. Missing values are null.
function columnValues(key) {
  if (key.startsWith("p")) {
    const parameter = REPORT.parameters[key.slice(1)];
    const rank = parameter.numeric ? parameter.values.map(Number) : parameter.values.map((_, k) => k);
    return parameter.at.map((k) => (k < 0 ? null : rank[k]));
  }
  if (key.startsWith("m")) return REPORT.measures.find((measure) => measure.name === key.slice(1)).values;
  return REPORT.labels.map((_, k) => k);
}

// Texts to search in, lower case, made when they are first needed.
const searchTexts = (() => {
  let texts = null;
  return () => (texts ??= REPORT.labels.map((label, k) =>
    [k + 1, label, REPORT.states[k], REPORT.errors[k] ?? "", ...REPORT.files[k]].join("\n").toLowerCase()));
})();

// A test for one filter: {key, values: Set of numbers or states} or {key, low, high}, with NaN for an open end.
function filterTest(filter) {
  if (filter.key === "state") return (k) => filter.values.has(REPORT.states[k]);
  if (filter.values) {
    const { at } = REPORT.parameters[filter.key.slice(1)];
    return (k) => filter.values.has(at[k]);
  }
  const values = columnValues(filter.key);
  return (k) => values[k] !== null && !(values[k] < filter.low) && !(values[k] > filter.high);
}

// Indices of the variants that pass all filters and contain every word of `text`.
function matching(filters, text) {
  const words = text.toLowerCase().split(/\s+/).filter(Boolean);
  const tests = filters.map(filterTest);
  if (words.length) {
    const texts = searchTexts();
    tests.push((k) => words.every((word) => texts[k].includes(word)));
  }
  const found = [];
  for (let k = 0; k < COUNT; k++) if (tests.every((test) => test(k))) found.push(k);
  return found;
}

// `indices` by the values of a column; missing values come last either way, equal ones stay in their order.
function ordered(indices, key, descending) {
  const values = columnValues(key);
  const sign = descending ? -1 : 1;
  return [...indices].sort((a, b) => {
    if (values[a] === null || values[b] === null) return (values[a] === null) - (values[b] === null) || a - b;
    return sign * (values[a] - values[b]) || a - b;
  });
}

// Cells of a grid: a map from "x,y" to the variants of `indices` there. Parameters that are on no axis are held at
// a value: `held[p]` is its index, or -1 for any.
function gridCells(indices, x, y, held) {
  const cells = new Map();
  const others = REPORT.parameters.map((_, p) => p).filter((p) => p !== x && p !== y && held[p] >= 0);
  for (const k of indices) {
    if (others.some((p) => REPORT.parameters[p].at[k] !== held[p])) continue;
    const key = `${REPORT.parameters[x].at[k]},${y < 0 ? 0 : REPORT.parameters[y].at[k]}`;
    if (cells.has(key)) cells.get(key).push(k);
    else cells.set(key, [k]);
  }
  return cells;
}

// True if every value of every parameter goes with every other, as after several -D.
function isFullGrid() {
  return REPORT.parameters.reduce((product, { values }) => product * values.length, 1) === COUNT;
}
