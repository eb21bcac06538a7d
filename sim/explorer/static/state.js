// The state of the page, and how gestures and answers change it. Nothing here writes into a state: each function returns
// the next one.

import { engineering } from "./notation.js";

/** Numbers of the sliders by key [SI].
 * @typedef {Record<string, number>} Values */
/** @typedef {{ key: string, meaning: string, symbol: string, unit: string, value: number, low: number, high: number,
 *   logarithmic: boolean, marked: boolean, over_wavelength: number | null }} Slider */
/** @typedef {"motion" | "sweep" | "speed" | "data" | "spread" | "map"} Figure */
/** What the server tells once.
 * @typedef {{ title: string, question: string, path: string, stamp: string, sliders: Slider[], points: Values[],
 *   mechanisms: { key: string, name: string, on: number }[], figures: Figure[], preview: string[], members: number,
 *   duration: number, speed: number, mount: string, data: string | null, alone: boolean }} Start */
/** @typedef {{ share: number, absolute: boolean, first: boolean, loads: boolean, figure: Figure }} View */
/** @typedef {{ values: Values, view: View }} Snapshot */
/** An answer with the question that it belongs to.
 * @typedef {{ of: any, answer: any }} Answer */
/** The course of a motion. From each time of `pieces` on it is that of other numbers.
 * @typedef {{ run: string, last: number, steps: number, pieces: { from: number, of: Values }[],
 *   columns: Record<string, (number | null)[]>, time: number, paused: boolean, rate: number, note: string, words: string }} Motion */
/** @typedef {{ start: Start, values: Values, view: View, past: Snapshot[], future: Snapshot[], gesture: string,
 *   dragging: boolean, touched: string, accepted: Values | null,
 *   refusal: { key: string, text: string, reason: string, typed: boolean } | null,
 *   table: string | null, answers: Record<string, Answer>, job: { task: string, done: number, left: string } | null,
 *   report: string, run: Answer | null, pin: Answer | null, fit: (Answer & { values: Values }) | null, motion: Motion, reading: number | null,
 *   wavelength: boolean, trouble: string, unread: string }} State */

/** Numbers of the view that an address may hold beside those of sliders. */
const FLAGS = /** @type {const} */ (["absolute", "first", "loads"]);

/** Return the numbers of the scenario.
 * @param {Start} start
 * @returns {Values} */
export function original(start) {
  return Object.fromEntries(start.sliders.map(({ key, value }) => [key, value]));
}

/** @param {Start} start
 * @returns {View} */
const plain = (start) => ({
  share: 0.1,
  absolute: false,
  first: false,
  loads: false,
  figure: start.figures[0],
});

/** Return the state of a page that opens.
 * @param {Start} start
 * @returns {State} */
export function initial(start) {
  return {
    start,
    values: original(start),
    view: plain(start),
    past: [],
    future: [],
    gesture: "",
    dragging: false,
    touched: "",
    refusal: null,
    accepted: null,
    table: start.data,
    answers: {},
    job: null,
    report: "",
    run: null,
    pin: null,
    fit: null,
    motion: still(start),
    reading: null,
    wavelength: false,
    trouble: "",
    unread: "",
  };
}

/** Return the ratio to real time at which a motion is shown in ten to twenty seconds.
 * @param {Start} start */
export const rateOf = (start) => 10 ** Math.min(3, Math.max(-2, Math.round(Math.log10(start.duration / 20))));

/** Return a motion that has not begun.
 * @param {Start} start
 * @returns {Motion} */
function still(start) {
  const [columns, rate] = [{ t: [] }, rateOf(start)];
  return { run: "", last: 0, steps: 0, pieces: [], columns, time: 0, paused: false, rate, note: "", words: "" };
}

/** Return true if two lists of numbers are the same.
 * @param {any} one
 * @param {any} other */
export function same(one, other) {
  return one === other || JSON.stringify(one) === JSON.stringify(other);
}

/** @param {State} state
 * @returns {State} */
function kept(state) {
  const past = [...state.past, { values: state.values, view: state.view }].slice(-200);
  return { ...state, past, future: [], gesture: "", dragging: false, refusal: null, trouble: "" };
}

/** Return the state after numbers of sliders have been moved. Moves of one gesture are undone together.
 * @param {State} state
 * @param {Values} values
 * @param {string} gesture
 * @returns {State} */
export function moved(state, values, gesture = "") {
  const next = gesture && gesture === state.gesture ? { ...state, refusal: null } : kept(state);
  const touched = Object.keys(values)[0] ?? "";
  return { ...next, values: { ...state.values, ...values }, gesture, dragging: gesture !== "", touched };
}

/** Return the state after a change of the view.
 * @param {State} state
 * @param {Partial<View>} change
 * @param {string} gesture
 * @returns {State} */
export function viewed(state, change, gesture = "") {
  const next = gesture && gesture === state.gesture ? state : kept(state);
  return { ...next, view: { ...state.view, ...change }, gesture, dragging: gesture !== "" };
}

/** Return the state in which nothing is dragged. Further moves by keyboard still belong to the gesture.
 * @param {State} state
 * @returns {State} */
export const rested = (state) => ({ ...state, dragging: false });

/** Return the state in which the next move is another gesture.
 * @param {State} state
 * @returns {State} */
export const released = (state) => ({ ...state, gesture: "", dragging: false });

/** @param {State} state
 * @param {"past" | "future"} from
 * @param {"past" | "future"} to
 * @returns {State} */
function exchanged(state, from, to) {
  const snapshot = state[from].at(-1);
  if (!snapshot) return state;
  const here = { values: state.values, view: state.view };
  const moves = { [from]: state[from].slice(0, -1), [to]: [...state[to], here] };
  return { ...state, ...snapshot, ...moves, gesture: "", dragging: false, refusal: null, trouble: "" };
}

/** @param {State} state */
export const undone = (state) => exchanged(state, "past", "future");
/** @param {State} state */
export const redone = (state) => exchanged(state, "future", "past");

/** Return the state with the numbers of the scenario.
 * @param {State} state
 * @returns {State} */
export function reset(state) {
  return { ...kept(state), values: original(state.start), view: plain(state.start) };
}

/** Return true if a state has the numbers of the scenario.
 * @param {State} state */
export const isOriginal = (state) => same(state.values, original(state.start)) && same(state.view, plain(state.start));

/** Return the numbers that differ from the scenario as the words of an address.
 * @param {State} state
 * @returns {[string, string][]} */
export function words({ start, values, view }) {
  const result = start.sliders
    .filter(({ key, value }) => values[key] !== value)
    .map(({ key }) => /** @type {[string, string]} */ ([key, String(values[key])]));
  if (view.share !== 0.1) result.push(["share", String(view.share)]);
  for (const name of FLAGS) if (view[name]) result.push([name, "1"]);
  if (view.figure !== start.figures[0]) result.push(["figure", view.figure]);
  return result;
}

/** Return the state that an address describes. Words that are no numbers are named and left out.
 * @param {State} state
 * @param {URLSearchParams} address
 * @returns {State} */
export function linked(state, address) {
  const { start } = state;
  const values = original(start);
  const wrong = [];
  for (const { key } of start.sliders) {
    const word = address.get(key);
    if (word === null) continue;
    if (word.trim() !== "" && Number.isFinite(Number(word))) values[key] = Number(word);
    else wrong.push(`${key} = “${word.slice(0, 40)}”`);
  }
  const share = Number(address.get("share"));
  const figure = start.figures.find((name) => name === address.get("figure")) ?? start.figures[0];
  const view = { ...plain(start), figure, share: share > 0 && share < 1 ? share : 0.1 };
  for (const name of FLAGS) view[name] = address.get(name) === "1";
  const trouble = wrong.length
    ? `The address has ${wrong.join(", ")}, which cannot be read; the scenario's number is used`
    : "";
  if (same(values, state.values) && same(view, state.view)) return { ...state, trouble };
  const next = state.accepted ? kept(state) : state;
  return { ...next, values, view, trouble };
}

/** Return the state after a text was refused; the number before stays.
 * @param {State} state
 * @param {string} key
 * @param {string} text
 * @param {string} reason
 * @returns {State} */
export function refused(state, key, text, reason) {
  return { ...state, refusal: { key, text, reason, typed: true }, gesture: "" };
}

/** Return the state after an answer. One to a question that is no longer asked is kept with its question.
 * @param {State} state
 * @param {string} slot
 * @param {any} of
 * @param {any} answer
 * @returns {State} */
export function answered(state, slot, of, answer) {
  const next = { ...state, answers: { ...state.answers, [slot]: { of, answer } } };
  // the refusal of other numbers says nothing, but what is asked now may be asked again
  if (["curves", "shown"].includes(slot) && answer.faults && !same(of.values, state.values)) return { ...state };
  if (slot !== "curves") return next;
  if (!answer.faults) return { ...next, accepted: of.values };
  const { accepted, start, touched } = state;
  const reasons = Object.values(answer.faults).join("; ");
  if (!accepted) {
    const trouble = `The address cannot be used (${reasons}); the scenario's numbers are used`;
    const wrong = Object.keys(answer.faults).filter((key) => key in state.values);
    const sound = Object.entries(original(start)).filter(([key]) => wrong.includes(key) || !wrong.length);
    const values = { ...state.values, ...Object.fromEntries(sound) };
    // what is refused once more is the scenario's own
    return same(values, state.values) ? { ...next, trouble: reasons } : { ...state, values, trouble };
  }
  const wrong = Object.keys(answer.faults).find((key) => key in state.values) ?? touched;
  const slider = start.sliders.find(({ key }) => key === wrong);
  const past = same(state.past.at(-1)?.values, accepted) ? state.past.slice(0, -1) : state.past;
  const back = { ...state, values: accepted, past, gesture: "" };
  if (!slider) return { ...back, trouble: reasons };
  const text = engineering(state.values[wrong], slider.unit);
  const refusal = { key: wrong, text, reason: reasons, typed: false };
  return { ...back, refusal };
}

/** Return the state with the numbers of a fit, if they are wanted: by its end if nothing was moved meanwhile.
 * @param {State} state
 * @returns {State} */
export function withFit(state) {
  return state.fit ? moved(state, state.fit.values) : state;
}

/** Return true if the state has the numbers of the last fit, and those that the fit started from otherwise.
 * @param {State} state */
export function isFitted({ fit, values, table }) {
  return (
    fit !== null && fit.of.data === table && same({ ...fit.of.values, ...fit.values }, { ...fit.of.values, ...values })
  );
}

/** Return the state after the result of a job.
 * @param {State} state
 * @param {any} of
 * @param {any} result
 * @returns {State} */
export function finished(state, of, result) {
  const next = { ...state, job: null, report: "" };
  if (of.task === "ensemble") return { ...next, run: { of, answer: result } };
  const numbers = Object.entries(/** @type {Record<string, any>} */ (result.numbers));
  const values = Object.fromEntries(numbers.map(([key, { value }]) => [key, value]));
  const withResult = { ...next, fit: { of, answer: result, values } };
  const isAsked = same(of.values, state.values) && of.data === state.table;
  return isAsked && numbers.length ? withFit(withResult) : withResult;
}

/** Return the state in which its present curves are pinned for comparison, or none if they were.
 * @param {State} state
 * @returns {State} */
export function pinned(state) {
  const { curves } = state.answers;
  return { ...state, pin: state.pin || !curves || curves.answer.faults ? null : curves };
}

/** Return the state with a table of measured curves.
 * @param {State} state
 * @param {string} table
 * @returns {State} */
export const tabled = (state, table) => ({ ...state, table, fit: null, unread: "" });

/** Return the state with a part of a motion.
 * @param {State} state
 * @param {{ values: Values, run: string, step: number }} of
 * @param {any} answer
 * @returns {State} */
export function continued(state, of, answer) {
  const { motion, start } = state;
  const { run, first, last, steps, is_new: isNew, duration, columns, words } = answer;
  const from = (duration * first) / steps;
  const time = of.run || hasEnded(motion, start) ? 0 : motion.time;
  const old = isNew ? { ...still(start), paused: motion.paused, rate: motion.rate, time } : motion;
  const size = isNew ? 0 : count(old.columns.t, from, duration / steps);
  const joined = Object.fromEntries(
    Object.entries(/** @type {Record<string, (number | null)[]>} */ (columns)).map(([name, values]) => [
      name,
      [...(old.columns[name] ?? []).slice(0, size), ...values],
    ]),
  );
  const before = old.pieces.filter((piece) => piece.from < from || (first > 0 && piece.from === 0));
  const isSame = before.length > 0 && same(/** @type {any} */ (before.at(-1)).of, of.values);
  const pieces = isSame ? before : [...before, { from, of: of.values }];
  const note =
    isNew && of.step > 0 ? "The motion began anew, because the change alters the shape of the arrays." : motion.note;
  return { ...state, motion: { ...old, run, last, steps, columns: joined, pieces, note, words } };
}

/** Return the number of times up to a time, within half a step.
 * @param {(number | null)[]} times
 * @param {number} time
 * @param {number} step */
function count(times, time, step) {
  const found = times.findLastIndex((one) => /** @type {number} */ (one) <= time + 0.5 * step);
  return found + 1;
}

/** Return the request that continues the motion, or null if it has all of its steps under the present numbers. What is
 * dragged acts at its end, so that one gesture makes one change.
 * @param {State} state */
export function nextOfMotion({ motion, start, values, view, dragging }) {
  if (view.figure !== "motion" || dragging) return null;
  const isOf = same(motion.pieces.at(-1)?.of, values);
  if (isOf && motion.last === motion.steps && motion.steps > 0) return null;
  if (isOf) return { values, run: motion.run, step: motion.last };
  const { steps, last, run, time } = motion;
  if (time <= 0 || hasEnded(motion, start)) return { values, run: "", step: 0 };
  const block = Math.max(1, Math.floor(steps / 100));
  const here = Math.ceil((time / start.duration) * (steps / block)) * block;
  return { values, run, step: Math.min(last, here) };
}

/** Return true if a motion has been shown to its end.
 * @param {Motion} motion
 * @param {Start} start */
export const hasEnded = (motion, start) => motion.time >= start.duration * (1 - 1e-9);

/** Return the motion after a time of the viewer [s], as far as it is computed.
 * @param {State} state
 * @param {number} seconds
 * @returns {State} */
export function played(state, seconds) {
  const { motion, start } = state;
  const known = /** @type {number} */ (motion.columns.t.at(-1) ?? 0);
  const time = Math.max(motion.time, Math.min(known, motion.time + seconds * motion.rate, start.duration));
  return { ...state, motion: { ...motion, time } };
}

/** Return the state in which the motion of other numbers begins at a time, with a note on where they come from.
 * @param {State} state
 * @param {{ values: Values, time: number, words: string }} point */
export function begun(state, { values, time, words }) {
  const next = viewed(moved(state, values), { figure: "motion" });
  const { rate } = state.motion;
  const note = `The map has set ${words}. Undo returns to it.`;
  return { ...next, past: next.past.slice(0, -1), motion: { ...still(state.start), rate, time, note } };
}

/** Return the state with a change of the motion, such as a pause.
 * @param {State} state
 * @param {Partial<Motion>} change
 * @returns {State} */
export const withMotion = (state, change) => ({ ...state, motion: { ...state.motion, ...change } });

/** Return the place of a value on its slider, at most an end of it.
 * @param {Slider} slider
 * @param {number} value
 * @param {number} steps */
export function placeOf(slider, value, steps) {
  const scale = slider.logarithmic ? Math.log : Number;
  const [low, high, at] = [slider.low, slider.high, value].map((one) => scale(one));
  return Math.min(steps, Math.max(0, Math.round((steps * (at - low)) / (high - low))));
}

/** Return the value at a place of a slider, with four digits.
 * @param {Slider} slider
 * @param {number} place
 * @param {number} steps */
export function valueAt(slider, place, steps) {
  const share = place / steps;
  const value = slider.logarithmic
    ? slider.low * (slider.high / slider.low) ** share
    : slider.low + (slider.high - slider.low) * share;
  return Math.abs(value) < 1e-9 * Math.abs(slider.high) ? 0 : Number(value.toPrecision(4));
}

/** Return the text of a slider's value; of a length as a wavelength if that was chosen.
 * @param {State} state
 * @param {Slider} slider */
export function textOf({ values, wavelength }, slider) {
  const factor = wavelength && slider.over_wavelength ? slider.over_wavelength : 1;
  return engineering(values[slider.key] / factor, slider.unit);
}
