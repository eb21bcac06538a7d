// Figures: axes, lines and labels; and numbers with their units.

import assert from "node:assert/strict";
import { test } from "node:test";
import { axisOf, figure, placed, spread, strokes, ticked, ticks } from "../../../sim/explorer/static/figure.js";
import { at, ratio } from "../../../sim/explorer/static/live.js";
import { written } from "../../../sim/explorer/static/node.js";
import { engineering, greek, lettered } from "../../../sim/explorer/static/notation.js";

const THEME = { ink: "#000", soft: "#555", grid: "#ddd", back: "#fff" };

test("numbers have the prefix and the digits of sim's own tables", () => {
  const cases = [
    [1.203e-4, "m", "120.3 µm"],
    [42e-3, "J/m^2", "42 mJ/m²"],
    [4.55e-8, "m^2", "0.0455 mm²"],
    [1.6e6, "Pa", "1.6 MPa"],
    [0.8, "1", "0.8"],
    [0, "N", "0 N"],
    [-6.5e-7, "m", "-650 nm"],
    [0.05, "N s/m", "50 mN s/m"],
  ];
  for (const [value, unit, text] of cases) assert.equal(engineering(value, unit), text);
  assert.deepEqual(lettered("tau_0"), ["τ", "0"]);
  assert.equal(greek("chi = 0"), "χ = 0");
});

test("a long trace keeps the least and the largest value of each column of pixels", () => {
  const size = 30000;
  const x = Array.from({ length: size }, (_, k) => k);
  const y = x.map(() => 1);
  [y[12345], y[23456]] = [9, -9]; // two slips, each in one record
  const [line] = strokes(
    x,
    y,
    (value) => (500 * value) / size,
    (value) => value,
  );
  assert.ok(line.length < 5 * 500);
  const heights = line.map(([, height]) => height);
  assert.deepEqual([Math.min(...heights), Math.max(...heights)], [-9, 9]);
});

test("a line is broken where there is no number", () => {
  const lines = strokes([1, 2, 3, 4], [1, null, 3, 4], Number, Number);
  assert.deepEqual(lines, [
    [[1, 1]],
    [
      [3, 3],
      [4, 4],
    ],
  ]);
});

test("noise does not fill a panel", () => {
  const { low, high } = axisOf("A", [[1, 1.00008]]);
  assert.ok(high - low >= 0.05);
  assert.equal(axisOf("A", [[3, 4]], { zero: true }).low, 0);
});

test("ticks are round numbers within the axis, in the order of decades on a logarithmic one", () => {
  assert.deepEqual(ticks({ low: 0, high: 104, log: false }, 6).large, [0, 20, 40, 60, 80, 100]);
  assert.deepEqual(ticks({ low: 0.01, high: 100, log: true }, 8).large, [0.01, 0.1, 1, 10, 100]);
  assert.deepEqual(ticks({ low: 0.9, high: 6, log: true }, 8).large, [1, 2, 5]);
  assert.deepEqual([ticked(0.0001), ticked(80000000), ticked(-0.5)], ["10⁻⁴", "8·10⁷", "−0.5"]);
  const place = placed({ label: "", low: 1, high: 100, log: true }, 0, 10);
  assert.ok(Math.abs(place(10) - 5) < 1e-12);
});

test("labels at the ends of curves do not hide each other", () => {
  const places = spread([{ at: 10 }, { at: 11 }, { at: 12 }, { at: 99 }], 0, 100);
  for (let k = 1; k < places.length; k += 1) assert.ok(places[k] - places[k - 1] >= 13.9);
  assert.ok(places[3] <= 100);
});

test("a figure has a name, a description and no markup of a hostile label", () => {
  const axis = { label: "x", low: 0, high: 1, log: false };
  const mark = { kind: "line", x: [0, 1], y: [0, 1], colour: "#000", label: "<script>" };
  const about = { width: 400, theme: THEME, title: "a <b>", description: "d" };
  const text = written(figure([{ x: axis, y: axis, height: 100, marks: [mark] }], about));
  assert.match(text, /<title id="figure-title">a &lt;b>/);
  assert.ok(!text.includes("<script>") && text.includes("&lt;script>") && text.includes("<desc"));
});

test("a point that a logarithmic axis cannot show is not drawn", () => {
  const log = { label: "x", low: 0.1, high: 10, log: true };
  const axis = { label: "y", low: 0, high: 1, log: false };
  const mark = { kind: "points", x: [0, 1], y: [0.5, 0.5], colour: "#000", name: "own" };
  const about = { width: 400, theme: THEME, title: "", description: "" };
  const text = written(figure([{ x: log, y: axis, height: 100, marks: [mark] }], about));
  assert.equal(text.match(/<circle/g)?.length, 1);
  assert.ok(!text.includes("Infinity") && !text.includes("NaN"));
});

test("an axis without a label has no numbers, and a band may have a title", () => {
  const axis = { label: "x", low: 0, high: 1, log: false };
  const mark = { kind: "band", x: [0, 1], y: [0, 0], high: [1, 1], colour: "#000", title: "a cell" };
  const about = { width: 400, theme: THEME, title: "", description: "" };
  const text = (label) => written(figure([{ x: axis, y: { ...axis, label }, height: 100, marks: [mark] }], about));
  assert.ok(text("y").includes('text-anchor="end"') && !text("").includes('text-anchor="end"'));
  assert.ok(text("").includes("<title>a cell</title>"));
});

test("a motion is read between its records, and its ratio to real time has words", () => {
  const motion = { columns: { t: [0, 1, 2], a: [0, 10, null] }, time: 0.25 };
  assert.equal(at(motion, "a"), 2.5);
  assert.equal(at({ ...motion, time: 1.5 }, "a"), 10);
  assert.deepEqual([ratio(0.1), ratio(1), ratio(1 / 30), ratio(10)], ["1 : 10", "1 : 1", "1 : 30", "10 : 1"]);
});
