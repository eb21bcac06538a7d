// Which questions the state asks, and whether an answer is one to them. No answer is drawn as that of other numbers.

import { engineering, lettered } from "./notation.js";
import { same } from "./state.js";

/** @typedef {import("./state.js").State} State */
/** @typedef {import("./state.js").Values} Values */

/** @param {State} state */
const drawn = ({ view }) => (view.figure === "sweep" ? "sweep" : "speed");

/** Return true if the server describes the figure.
 * @param {State} state */
export const isDescribed = ({ view }) => ["data", "spread", "map"].includes(view.figure);

/** Questions by the name of their answer, in the order in which they are asked.
 * @type {Record<string, (state: State) => any>} */
export const QUESTIONS = {
  before: (state) => ({ values: {}, share: 0.1, figure: drawn(state) }),
  curves: (state) => ({
    values: state.values,
    share: state.view.share,
    figure: drawn(state),
    data: state.table,
  }),
  shown: (state) => isDescribed(state) && { values: state.values, figure: state.view.figure, data: state.table },
  words: (state) => ({ values: state.values }),
  contact: (state) => ({ values: state.values, speed: speedOf(state) }),
  // the first one imports modules for seconds
  band: (state) => ({ values: state.values }),
  others: (state) =>
    (!state.start.alone || state.view.loads) && {
      values: state.values,
      figure: state.view.figure === "motion" ? "motion" : drawn(state),
      loads: state.view.loads,
    },
};

/** Addresses of the server that differ from the name of the answer. */
export const ADDRESSES = new Map([["before", "curves"]]);

/** Return the speed at which the contact is drawn.
 * @param {State} state */
function speedOf(state) {
  const curves = state.answers.curves?.answer;
  if (!curves?.x || state.view.figure !== "speed") return state.start.speed;
  return curves.level.places[0] ?? curves.x[Math.floor(curves.x.length / 2)];
}

/** Return true if the answer of a name is one to the present question.
 * @param {State} state
 * @param {string} name */
export function isCurrent(state, name) {
  const [found, question] = [state.answers[name], QUESTIONS[name](state)];
  return !question || (Boolean(found) && same(found.of, question) && !found.answer.more);
}

/** Return the answer of a name if it belongs to the present numbers and has no faults, else null.
 * @param {State} state
 * @param {string} name */
export function current(state, name) {
  const found = state.answers[name];
  const isAnswer = found && QUESTIONS[name](state) && isCurrent(state, name);
  return isAnswer && !found.answer.faults ? found.answer : null;
}

/** Answers that wait for the end of a gesture, and for each other. */
export const LATE = ["words", "contact", "band"];

/** Return the names of answers that are due. Those that depend on the curves wait for them.
 * @param {State} state */
export function due(state) {
  const names = Object.keys(QUESTIONS).filter((name) => !isCurrent(state, name));
  if (names.includes("curves")) return names.filter((name) => ["before", "curves", "shown"].includes(name));
  const late = state.view.figure === "motion" ? [...LATE, "others"] : LATE;
  return state.dragging ? names.filter((name) => !late.includes(name)) : names;
}

/** Return numbers of sliders in words, such as "P = 4 mN".
 * @param {State} state
 * @param {Values} values */
export function named({ start }, values) {
  const sliders = start.sliders.filter(({ key }) => key in values);
  return sliders.map(({ key, symbol, unit }) => {
    const name = lettered(symbol).join("") || key.split(".").at(-1);
    return `${name} = ${engineering(values[key], unit)}`;
  });
}

/** Return in words how numbers differ from the present ones; "" if they do not.
 * @param {State} state
 * @param {Values} of */
export function differences(state, of) {
  const words = named(
    state,
    Object.fromEntries(Object.entries(of).filter(([key, value]) => value !== state.values[key])),
  );
  return words.length > 3 ? `${words.slice(0, 3).join(", ")}, and ${words.length - 3} more` : words.join(", ");
}

/** Return what an ensemble is called in the figure: its members, and its numbers if they are not the present ones.
 * @param {State} state */
export function nameOfRun(state) {
  if (!state.run) return "";
  const other = differences(state, state.run.of.values);
  return other ? `ran at ${other}` : nameOf(state.run.answer.members);
}

/** Return what an ensemble of the present numbers is called.
 * @param {number} members */
export const nameOf = (members) => (members > 1 ? `mean of ${members} members` : "own models");
