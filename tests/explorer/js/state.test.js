// The state of the page: gestures, answers and what belongs to what.

import assert from "node:assert/strict";
import { test } from "node:test";
import { current, differences, due, isCurrent, nameOfRun, QUESTIONS } from "../../../sim/explorer/static/answer.js";
import * as change from "../../../sim/explorer/static/state.js";

const slider = (key, value, more = {}) => ({
  key,
  meaning: key,
  symbol: key === "contact.load" ? "P" : "",
  unit: key === "contact.load" ? "N" : "Pa",
  value,
  low: value / 30,
  high: 30 * value,
  logarithmic: true,
  marked: false,
  over_wavelength: null,
  ...more,
});
const START = {
  title: "",
  question: "",
  path: "",
  sliders: [slider("contact.load", 4e-3), slider("solid.shear_modulus", 1.6e6)],
  points: [],
  mechanisms: [],
  figures: ["speed"],
  preview: [],
  members: 8,
  duration: 2,
  speed: 1e-3,
  mount: "load",
  data: null,
};
const LOAD = "contact.load";
const opened = () => answered(change.initial(START));
const answered = (state) =>
  change.answered(state, "curves", QUESTIONS.curves(state), { x: [1e-3], level: { places: [] }, values: state.values });

test("each move is undone and done again, and moves of one gesture together", () => {
  let state = opened();
  for (const value of [5e-3, 6e-3, 7e-3]) state = change.moved(state, { [LOAD]: value }, LOAD);
  state = change.moved(change.released(state), { [LOAD]: 8e-3 }, LOAD);
  assert.equal(state.past.length, 2);
  assert.equal(change.undone(state).values[LOAD], 7e-3);
  assert.equal(change.undone(change.undone(state)).values[LOAD], 4e-3);
  assert.equal(change.redone(change.undone(state)).values[LOAD], 8e-3);
});

test("curves are due after a move, and words only after the gesture", () => {
  let state = opened();
  assert.ok(!due(state).includes("curves"));
  state = change.moved(state, { [LOAD]: 5e-3 }, LOAD);
  assert.deepEqual(due(state), ["before", "curves"]);
  state = answered(state);
  assert.ok(!due(state).includes("words") && due(state).includes("others"));
  assert.ok(!due(state).includes("band"));
  assert.ok(["words", "band"].every((name) => due(change.rested(state)).includes(name)));
});

test("a scenario of a single point has no others but other loads", () => {
  const state = { ...opened(), start: { ...START, alone: true } };
  assert.ok(!due(state).includes("others"));
  const loads = change.viewed(state, { loads: true });
  assert.ok(due(loads).includes("others"));
  const shown = change.answered(loads, "others", QUESTIONS.others(loads), { others: [{}] });
  assert.equal(current(shown, "others").others.length, 1);
  assert.equal(current(change.viewed(shown, { loads: false }), "others"), null);
});

test("the figure of a table is asked for with the curves, and the refusal of other numbers does not take its place", () => {
  const first = { ...opened(), table: "t" };
  const shown = (state, answer) => change.answered(state, "shown", QUESTIONS.shown(state), answer);
  let state = change.viewed(first, { figure: "data" });
  state = change.answered(state, "curves", QUESTIONS.curves(state), { x: [1], level: { places: [1] } });
  state = shown(state, { panels: [] });
  const moved = change.moved(state, { [LOAD]: 16e-3 });
  assert.deepEqual(due(moved), ["before", "curves", "shown"]);
  // the curves are refused first, so that the numbers are those before
  const back = change.answered(moved, "curves", QUESTIONS.curves(moved), { faults: { "": "no contact" } });
  const late = change.answered(back, "shown", QUESTIONS.shown(moved), { faults: { "": "no contact" } });
  assert.deepEqual(late.answers.shown, state.answers.shown);
  assert.ok(isCurrent(late, "shown"));
});

test("an answer to another question is not that of the present numbers", () => {
  const before = opened();
  const late = QUESTIONS.words(before);
  const state = change.answered(change.moved(before, { [LOAD]: 5e-3 }), "words", late, { diagnosis: [] });
  assert.ok(!isCurrent(state, "words"));
  assert.equal(current(state, "words"), null);
  assert.notEqual(current(change.undone(state), "words"), null);
});

test("a run of other numbers is named by them", () => {
  const state = opened();
  const of = { task: "ensemble", values: state.values, members: 8 };
  const moved = change.finished(change.moved(state, { [LOAD]: 16e-3 }), of, { members: 8, along: "speed" });
  assert.equal(nameOfRun(moved), "ran at P = 4 mN");
  assert.equal(nameOfRun(change.undone(moved)), "mean of 8 members");
  assert.equal(differences(moved, moved.values), "");
});

test("a fit moves sliders only if nothing else has moved meanwhile", () => {
  const state = { ...opened(), table: "t" };
  const of = { task: "fit", values: state.values, data: "t", free: [LOAD] };
  const result = { numbers: { [LOAD]: { value: 9e-3, low: 8e-3, high: 1e-2 } }, text: "", remarks: [] };
  assert.equal(change.finished(state, of, result).values[LOAD], 9e-3);
  const moved = change.finished(change.moved(state, { [LOAD]: 16e-3 }), of, result);
  assert.equal(moved.values[LOAD], 16e-3);
  assert.equal(change.withFit(moved).values[LOAD], 9e-3);
});

test("refused numbers give way to the last good ones, without a trace in undo", () => {
  const state = change.moved(opened(), { [LOAD]: 16e-3 }, LOAD);
  const refused = change.answered(state, "curves", QUESTIONS.curves(state), { faults: { "": "no contact" } });
  assert.equal(refused.values[LOAD], 4e-3);
  assert.deepEqual(refused.refusal, { key: LOAD, text: "16 mN", reason: "no contact", typed: false });
  assert.equal(refused.past.length, 0);
  assert.equal(change.reset(change.refused(refused, LOAD, "abc", "cannot be read")).refusal, null);
  // and a refusal of earlier numbers changes nothing
  const later = change.moved(state, { [LOAD]: 5e-3 });
  const ignored = change.answered(later, "curves", QUESTIONS.curves(state), { faults: { "": "x" } });
  assert.deepEqual(ignored, later);
  assert.notEqual(ignored, later); // so that the page asks for the curves of the later numbers
});

test("an address with a number that cannot be used falls back to the scenario's, and says so", () => {
  const words = new URLSearchParams({ [LOAD]: "abc", "solid.shear_modulus": "2e6", share: "0.2" });
  const state = change.linked(change.initial(START), words);
  assert.deepEqual([state.values[LOAD], state.values["solid.shear_modulus"], state.view.share], [4e-3, 2e6, 0.2]);
  assert.match(state.trouble, /contact.load/);
  const faults = { faults: { "solid.shear_modulus": "must be above 0" } };
  const refused = change.answered(state, "curves", QUESTIONS.curves(state), faults);
  assert.equal(refused.values["solid.shear_modulus"], 1.6e6);
  assert.match(refused.trouble, /above 0/);
  assert.deepEqual(change.words(change.moved(refused, { [LOAD]: 5e-3 })), [
    [LOAD, "0.005"],
    ["share", "0.2"],
  ]);
});

test("a motion goes on from the block that is shown, under the new numbers", () => {
  let state = { ...change.initial({ ...START, figures: ["motion", "speed"] }) };
  const request = change.nextOfMotion(state);
  assert.deepEqual([request.run, request.step], ["", 0]);
  const part = (first, last, isNew) => ({
    run: "r",
    first,
    last,
    steps: 200,
    duration: 2,
    is_new: isNew,
    columns: { t: Array.from({ length: last - first }, (_, k) => (2 * (first + k + 1)) / 200) },
  });
  state = change.continued(state, request, part(0, 100, true));
  assert.equal(change.nextOfMotion(state).step, 100);
  state = change.continued(state, change.nextOfMotion(state), part(100, 200, false));
  assert.equal(change.nextOfMotion(state), null);
  assert.equal(change.played(state, 1000).motion.time, 2);
  state = change.played(state, 10); // at 1 : 10
  assert.ok(Math.abs(state.motion.time - 1) < 1e-12);
  // what is dragged acts at its end
  state = change.moved(state, { [LOAD]: 6e-3 }, LOAD);
  assert.equal(change.nextOfMotion(state), null);
  state = change.rested(change.moved(state, { [LOAD]: 5e-3 }, LOAD));
  const next = change.nextOfMotion(state);
  assert.deepEqual([next.run, next.step, next.values[LOAD]], ["r", 100, 5e-3]);
  state = change.continued(state, next, part(100, 200, false));
  assert.equal(state.motion.columns.t.length, 200);
  assert.deepEqual(
    state.motion.pieces.map(({ from }) => from),
    [0, 1],
  );
  assert.equal(change.nextOfMotion(state), null);
});

test("a slider's place and its value are inverse to each other", () => {
  for (const one of [START.sliders[0], slider("a", 1, { low: -4, high: 4, logarithmic: false })]) {
    for (const place of [0, 1, 150, 299, 300]) {
      assert.ok(change.placeOf(one, change.valueAt(one, place, 300), 300) === place);
    }
  }
});
