// The page that belongs to a state.

import { current, differences, isCurrent, isDescribed, nameOfRun, named } from "./answer.js";
import { figure, frames, path, placed, ticked } from "./figure.js";
import { picture, ratio, reading } from "./live.js";
import { $, h, put } from "./node.js";
import { digits, engineering, lettered, scaled } from "./notation.js";
import { COLOURS, curvesOf, described, describedOf, panels, tableOf } from "./panels.js";
import { hasEnded, isFitted, isOriginal, placeOf, rateOf, textOf } from "./state.js";

/** @typedef {import("./state.js").State} State */
/** @typedef {import("./state.js").Slider} Slider */
/** @typedef {import("./figure.js").Theme} Theme */
/** @typedef {import("./figure.js").Mark} Mark */
/** @typedef {import("./figure.js").Panel} Panel */
/** @typedef {import("./node.js").Node} Node */
/** Where a state is drawn: widths of the figure and of the sections below it [pixels], and the ratio of the motion to
 * real time that was reached.
 * @typedef {{ isDark: boolean, isNarrow: boolean, plot: number, words: number, reached: number }} Screen */

/** Steps of a slider. */
export const STEPS = 300;
const NAMES = {
  motion: "the motion",
  sweep: "over the sweep",
  speed: "over the sliding speed",
  data: "measured curves",
  spread: "spread of the members",
  map: "map of stability",
};
/** Titles of groups of sliders, and the tables of a scenario that they hold; the last one holds all others.
 * @type {[string, string[]][]} */
const GROUPS = [
  ["Load and mount", ["contact"]],
  ["Drive", ["drive"]],
  ["Bonds", ["bonds"]],
  ["Fluctuations", ["shear"]],
  ["Solids and adhesion", []],
];

/** Return the colours of figures.
 * @param {boolean} isDark
 * @returns {Theme} */
export const theme = (isDark) =>
  isDark
    ? { ink: "#e8e8e8", soft: "#b0b0b0", grid: "#33363b", back: "#16181b" }
    : { ink: "#1a1a1a", soft: "#595959", grid: "#e4e4e4", back: "#ffffff" };

/** What was made last under a name, with all that it depends on.
 * @type {Map<string, { parts: any[], result: any }>} */
const made = new Map();

/** Return what was made last under a name if it depends on the same parts, else make it anew.
 * @template T
 * @param {string} name
 * @param {any[]} parts
 * @param {() => T} make
 * @returns {T} */
function once(name, parts, make) {
  const last = made.get(name);
  if (last && parts.every((part, k) => part === last.parts[k])) return last.result;
  const result = make();
  made.set(name, { parts, result });
  return result;
}

/** Show a state.
 * @param {State} state
 * @param {Screen} screen */
export function render(state, screen) {
  const { start, trouble, past, future, view } = state;
  document.title = start.title;
  put("title", {}, start.title);
  put("question", {}, start.question);
  put("trouble", { hidden: !trouble }, trouble);
  put("undo", { disabled: !past.length });
  put("redo", { disabled: !future.length });
  put("reset", { disabled: isOriginal(state) && !state.refusal });
  choices(state);
  sliders(state);
  words(state);
  job(state);
  data(state);
  plot(state, screen);
  contact(state, screen);
}

/** Return an input with its label.
 * @param {Node["attributes"]} attributes
 * @param {string} words */
const labelled = (attributes, words) => h("label", {}, h("input", attributes), ` ${words}`);

/** Show the figures to choose from, and what can be chosen for the curves.
 * @param {State} state */
function choices(state) {
  const { start, view, table, values } = state;
  const names = start.figures.filter((name) => name !== "data" || table);
  const figures = names.map((name) =>
    labelled({ type: "radio", name: "figure", value: name, checked: name === view.figure }, NAMES[name]),
  );
  put("figures", { hidden: names.length < 2 }, h("legend", {}, "Figure"), ...figures);
  const isOfCurves = view.figure !== "motion" && !isDescribed(state);
  put("view", { hidden: !isOfCurves });
  const reasons = start.preview.join(", and ");
  const preview = `Preview: steady sliding is not what this scenario computes, because ${reasons}. Choose the motion, or run the scenario's own models.`;
  put("preview", { hidden: !isOfCurves || !reasons }, preview);
  for (const name of /** @type {const} */ (["absolute", "first", "loads"])) put(name, { checked: view[name] });
  // of one mechanism alone there is no order
  const curves = curvesOf(state)?.curves;
  const isLost = (/** @type {string} */ name) => curves?.[name]?.some((/** @type {number} */ lost) => lost > 1e-6);
  $("first").parentElement.hidden = !isLost("lost_to_bonds") || !isLost("lost_to_fluctuations");
  const level = String(Math.round(100 * view.share));
  put("level", { value: level, "aria-valuetext": `${level} %` });
  put("percent", {}, `${level} %`);
  const here = start.points.findIndex((point) => Object.entries(point).every(([key, value]) => values[key] === value));
  const points = start.points.map((point, place) =>
    h("option", { value: String(place), selected: place === here }, named(state, point).join(", ")),
  );
  put("points", { hidden: !points.length });
  put("point", {}, h("option", { value: "", selected: here < 0 }, "none of them"), ...points);
  const mechanisms = start.mechanisms.map(({ key, name }) =>
    labelled({ type: "checkbox", name: "mechanism", value: key, checked: values[key] !== 0 }, name),
  );
  const legend = h("legend", { class: "seen" }, "What reduces the adhesion");
  put("mechanisms", { hidden: !mechanisms.length }, legend, ...mechanisms);
}

/** Show the sliders in their groups.
 * @param {State} state */
function sliders(state) {
  const { start, refusal } = state;
  const numbers = isFitted(state) ? state.fit?.answer.numbers : {};
  const titleOf = (/** @type {Slider} */ { key }) =>
    (GROUPS.find(([, tables]) => tables.includes(key.split(".")[0])) ?? GROUPS[GROUPS.length - 1])[0];
  const control = (/** @type {Slider} */ slider) => {
    const { key } = slider;
    const own = refusal?.key === key ? refusal : null;
    // its place may have been changed by a reader, and its number taken back, without a frame between
    const parts = [state.values[key], own, numbers[key], state.wavelength, $(key)?.value];
    return once(key, parts, () => controlOf(state, slider, own, numbers[key]));
  };
  const groups = GROUPS.map(([title]) => {
    const own = start.sliders.filter((slider) => titleOf(slider) === title);
    return h("details", { open: "" }, h("summary", {}, title), ...own.map(control));
  });
  put("groups", {}, ...groups.filter(({ children }) => children.length > 1));
  for (const { key } of start.sliders) {
    const field = $(`text ${key}`);
    if (isTyped(field)) continue;
    const text = refusal?.typed && refusal.key === key ? refusal.text : $(key).getAttribute("aria-valuetext");
    if (field.value !== text || field.dataset.shown !== text) field.value = field.dataset.shown = text;
  }
}

/** Return true if a text is being written that was not read yet.
 * @param {any} field */
export const isTyped = (field) => document.activeElement === field && field.value !== field.dataset.shown;

/** Return a slider with its field. The field has its text apart, so that none is taken from under the hands.
 * @param {State} state
 * @param {Slider} slider
 * @param {State["refusal"]} refusal of its number
 * @param {any} number of a fit */
function controlOf(state, slider, refusal, number) {
  const { key, meaning, symbol, marked } = slider;
  const words = textOf(state, slider);
  const [letter, index] = lettered(symbol);
  const option = (/** @type {string} */ value, /** @type {string} */ text) =>
    h("option", { value, selected: state.wavelength === (value !== "") }, text);
  const lengths = [option("", "correlation length"), option("1", "wavelength of the same energy")];
  const choice = h("select", { id: "meaning", "aria-label": "What the length is" }, ...lengths);
  const ends = { type: "range", id: key, min: 0, max: STEPS, step: 1 };
  const place = placeOf(slider, state.values[key], STEPS);
  const field = { type: "text", id: `text ${key}`, "aria-label": `${meaning}, with its unit` };
  const quiet = { autocomplete: "off", spellcheck: "false", "aria-invalid": String(Boolean(refusal)) };
  const fault = { id: `fault ${key}`, class: "fault", role: "alert", hidden: !refusal };
  return h(
    "div",
    { class: "slider" },
    h(
      "label",
      { for: key },
      `${marked ? "★ " : ""}${meaning}${symbol ? ", " : ""}${letter}`,
      h("sub", {}, index),
      " ",
      h("small", {}, key),
      ...(slider.over_wavelength ? [" ", choice] : []),
    ),
    h(
      "div",
      { class: "track" },
      h("input", { ...ends, value: String(place), "aria-valuetext": words }),
      ...interval(slider, number),
    ),
    h("input", { ...field, ...quiet, ...(refusal && { "aria-errormessage": fault.id }) }),
    h("p", fault, refusal ? `“${refusal.text}” ${refusal.reason}; ${words} stays in use` : ""),
  );
}

/** Return the 95 % interval of a number that was fitted, as long as the state has the numbers of the fit.
 * @param {Slider} slider
 * @param {any} number */
function interval(slider, number) {
  if (!number || ![number.low, number.high].every(Number.isFinite)) return [];
  const [from, to] = [number.low, number.high].map((end) => placeOf(slider, end, STEPS));
  const box = { viewBox: `0 0 ${STEPS} 4`, preserveAspectRatio: "none" };
  const bar = h("rect", { x: from, y: 0, width: Math.max(2, to - from), height: 4 });
  return [h("svg", { ...box, role: "img", "aria-label": "95 % interval of the fit" }, bar)];
}

/** Return the numbers to which the figure that is drawn belongs.
 * @param {State} state */
function valuesOf(state) {
  if (state.view.figure === "motion") return state.motion.pieces.at(-1)?.of;
  return (isDescribed(state) ? describedOf(state) : state.answers.curves)?.of.values;
}

/** Return the sentence of the figure.
 * @param {State} state */
function sentence(state) {
  if (state.view.figure === "motion") return course(state);
  return (isDescribed(state) ? describedOf(state)?.answer.words : curvesOf(state)?.level.words) ?? "";
}

/** Show the sentences. Those on earlier numbers are grey until new ones arrive.
 * @param {State} state */
function words(state) {
  const { pin, answers } = state;
  put("lost", { "data-of": JSON.stringify(valuesOf(state)) }, sentence(state));
  const at = pin ? differences(state, pin.of.values) : "";
  put("pinned", { hidden: !pin }, pin ? `Pinned${at ? ` at ${at}` : " here"}: ${pin.answer.level.words}` : "");
  put("pin", { "aria-pressed": String(Boolean(pin)) }, pin ? "Unpin" : "Pin");
  const look = { class: isCurrent(state, "words") ? "" : "earlier" };
  for (const id of ["diagnosis", "remarks"]) {
    const lines = answers.words?.answer[id] ?? [];
    put(id, look, ...lines.map((/** @type {string} */ line) => h("li", {}, line)));
  }
}

/** Return what the motion has shown, in words.
 * @param {State} state */
function course({ motion, start }) {
  const { columns, steps, last, pieces } = motion;
  if (!columns.t.length) return "The motion is being computed";
  /** @type {(name: string, unit: string) => string} */
  const range = (name, unit) => {
    let [low, high] = [Infinity, -Infinity];
    for (const value of columns[name]) if (value !== null) [low, high] = [Math.min(low, value), Math.max(high, value)];
    const [least, most] = [engineering(low, unit), engineering(high, unit)];
    return least === most ? least : `${least} to ${most}`;
  };
  const force = columns.spring_force ? "spring force" : columns.normal_load ? "load" : "friction";
  const name = columns.spring_force ? "spring_force" : columns.normal_load ? "normal_load" : "friction_force";
  const extent =
    last < steps
      ? `the first ${engineering(Number(columns.t.at(-1)), "s")} of ${engineering(start.duration, "s")}`
      : engineering(start.duration, "s");
  const changed =
    pieces.length > 1
      ? `, the numbers changed at ${pieces
          .slice(1)
          .map(({ from }) => engineering(from, "s"))
          .join(", ")}`
      : "";
  const events = motion.words && pieces.length < 2 ? `${motion.words}; ` : "";
  return `First member, ${extent}: ${events}${force} ${range(name, "N")}, area ${range("contact_area", "m^2")}${changed}`;
}

/** Show the job, and its end.
 * @param {State} state */
function job(state) {
  put("stop", { disabled: !state.job });
  put("progress", { hidden: !state.job, value: state.job?.done ?? 0 });
  const left = state.job?.left ? `${state.job.left} left` : "";
  put("ran", {}, state.job ? left : state.report || ran(state) || (current(state, "band")?.reason ?? ""));
}

/** Return what the last ensemble was, in words.
 * @param {State} state */
function ran(state) {
  if (!state.run) return "";
  const { members, along, words } = state.run.answer;
  const motion = members > 1 ? `mean of ${members} members with its 95 % interval` : "all members are equal";
  const curve = members > 1 ? `${members} members: mean and 95 % interval` : "all members are equal: one of them";
  const name = along === "t" ? `${motion}: ${words}` : `${curve} in the figure over the speed`;
  const isEarlier = differences(state, state.run.of.values) !== "";
  return isEarlier ? `${name}; of earlier numbers: ${nameOfRun(state)}` : name;
}

/** Show how well the curves fit the points, and the last fit.
 * @param {State} state */
function data(state) {
  const { start, fit, table, unread } = state;
  const found = curvesOf(state)?.data;
  const judged = unread || (found ? `${found.name}: ${found.words}` : "");
  put("judged", { hidden: !judged }, judged);
  const free = start.sliders.map(({ key }) => labelled({ type: "checkbox", value: key }, key));
  put("free", { hidden: !table }, h("legend", { class: "seen" }, "Fit these numbers"), ...free);
  for (const id of ["fit", "plan"]) put(id, { disabled: !table || state.job !== null });
  const isPresent = isFitted(state);
  put("fitted", { hidden: !fit, class: isPresent ? "" : "earlier" });
  put("earlier", { hidden: isPresent }, "This fit is of earlier numbers or another table.");
  put("use", { hidden: isPresent });
  put("found", {}, fit ? [fit.answer.text, ...fit.answer.remarks].join("\n") : "");
}

/** The figure that is drawn, for reading and saving.
 * @type {{ panels: Panel[], node: Node | null, width: number, shared: boolean, about: Node["attributes"] }} */
export const drawn = { panels: [], node: null, width: 0, shared: true, about: {} };

/** Draw the figure. While the curves of a move are under way all of it stays that of the numbers before.
 * @param {State} state
 * @param {Screen} screen */
function plot(state, screen) {
  const { answers, motion, view, run, pin, fit, reading: place } = state;
  const { curves, before, others, band, shown } = answers;
  const isMotion = view.figure === "motion";
  put("live", { hidden: !isMotion });
  const sources = [curves, before, others, band, shown, motion.columns, motion.pieces, view, run, pin, fit, place];
  const parts = [...sources, screen.isDark, screen.isNarrow, screen.plot, $("numbers").open];
  once("plot", parts, () => redraw(state, screen));
  now(state, screen);
}

/** @param {State} state
 * @param {Screen} screen */
function redraw(state, { isDark, isNarrow, plot: room }) {
  const { start, view, motion, answers } = state;
  const look = theme(isDark);
  drawn.panels = panels(state, look, isNarrow);
  drawn.node = null;
  if (!drawn.panels.length) return put("reader", { hidden: true });
  drawn.width = Math.max(300, room);
  drawn.shared = view.figure === "motion" ? !motion.columns.normal_load : !["data", "map"].includes(view.figure);
  // a narrow figure has fewer panels than its table
  const wide = isNarrow ? panels(state, look, false) : drawn.panels;
  /** @type {ReturnType<typeof tableOf>} */
  const table = describedOf(state)?.answer.table ?? tableOf(wide);
  put("reader", { hidden: !table.rows.length });
  const mark = readAt(state, table);
  const across = drawn.panels[0].x.label;
  const read = drawn.panels.map((panel) =>
    mark && panel.x.label === across ? { ...panel, marks: [...panel.marks, mark] } : panel,
  );
  const name = { title: `${start.title}: ${NAMES[view.figure]}`, description: sentence(state) };
  drawn.node = figure(read, { ...name, theme: look, width: drawn.width, shared: drawn.shared });
  drawn.about = {
    // a figure that is higher than a small screen would hide what is below it if it stayed in sight
    class: Number(drawn.node.attributes.height) > 330 ? "tall" : "",
    "data-share": answers.curves?.of.share,
    "data-of": JSON.stringify(valuesOf(state)),
  };
  if (!$("numbers").open) return;
  const head = h("tr", {}, ...table.head.map((text) => h("th", { scope: "col" }, text)));
  const rows = table.rows.map((row) =>
    h("tr", {}, ...row.map((value) => h("td", {}, value === null ? "–" : digits(value)))),
  );
  put("table", {}, h("table", {}, head, ...rows));
}

/** Show the numbers at the reading point, and return its line in the figure.
 * @param {State} state
 * @param {{ head: string[], rows: (number | null)[][] }} table
 * @returns {Mark | null} */
function readAt(state, { head, rows }) {
  const place = Math.min(rows.length - 1, state.reading ?? 0);
  const row = rows[place] ?? [];
  const { left, right } = frames(drawn.panels, drawn.width, drawn.shared);
  const words = head.map((text, k) => {
    const [, name, unit = ""] = /^(.*?)(?: \((.*)\))?$/.exec(text) ?? [];
    const value = row[k] ?? null;
    return `${name} ${value === null ? "–" : ticked(Number(digits(value)))} ${unit}`.trim();
  });
  const style = `width: ${right - left + 16}px`;
  put("at", { max: rows.length - 1, value: String(place), style, "aria-valuetext": words.join("; ") });
  put("reading", {}, state.reading === null ? "" : words.join(" · "));
  if (state.reading === null || typeof row[0] !== "number") return null;
  return { kind: "rule", x: [row[0]], y: [], colour: COLOURS.own, width: 1, dash: "2 3", name: "reading" };
}

/** Draw the moment of the motion, and put the figure on the page.
 * @param {State} state
 * @param {Screen} screen */
export function now(state, screen) {
  const { motion, start, view } = state;
  const isMotion = view.figure === "motion";
  if (isMotion) {
    const map = current(state, "contact")?.waves ?? null;
    put("waves", { hidden: !map });
    put("scene-live", {}, picture(state, theme(screen.isDark), Math.max(300, screen.plot), map));
    put("moment", {}, reading(state) + (motion.note ? ` · ${motion.note}` : ""));
    const ended = hasEnded(motion, start);
    put("play", {}, ended ? "Play again" : motion.paused ? "Play" : "Pause");
    const isMoving = !motion.paused && !ended && screen.reached > 0;
    put("ratio", {}, isMoving ? `now ${ratio(screen.reached)}` : "");
    const rates = [10, 10 / 3, 1, 1 / 3, 0.1].map((factor) => factor * rateOf(start));
    const options = rates.map((rate) =>
      h("option", { value: String(rate), selected: Math.abs(rate / motion.rate - 1) < 1e-6 }, ratio(rate)),
    );
    put("rate", {}, ...options);
  }
  const { node, about } = drawn;
  if (!node) put("plot", about);
  else if (!isMotion) put("plot", about, node);
  else put("plot", about, { ...node, children: [...node.children, h("g", { class: "now" }, ...moment(state))] });
}

/** Return the marks of the present moment in the panels of the motion.
 * @param {State} state */
function moment({ motion, start }) {
  const { left, right, rows } = frames(drawn.panels, drawn.width, drawn.shared);
  return drawn.panels.flatMap((panel, k) => {
    const [top, bottom] = rows[k];
    const acrossOf = placed(panel.x, left, right);
    const loop = panel.marks.find(({ name }) => name === "loop");
    if (!loop) {
      const across = acrossOf(motion.time * scaled(start.duration, "s")[0]).toFixed(1);
      return [path(`M${across} ${top}V${bottom}`, { stroke: COLOURS.fluctuations, "stroke-width": 1.5 })];
    }
    const last = motion.columns.t.findLastIndex((t) => Number(t) <= motion.time);
    const place = Math.min(loop.x.length - 1, last);
    const [across, along] = [loop.x[place] ?? null, loop.y[place] ?? null];
    if (across === null || along === null) return [];
    const at = { cx: acrossOf(across), cy: placed(panel.y, bottom, top)(along) };
    return [h("circle", { ...at, r: 5, fill: COLOURS.fluctuations })];
  });
}

/** Show the contact. One of earlier numbers is grey until a new one arrives.
 * @param {State} state
 * @param {Screen} screen */
function contact(state, { isDark, words: room }) {
  const found = current(state, "contact");
  for (const id of ["contact", "scene"]) $(id).classList.toggle("earlier", !found);
  if (!found) return;
  once("contact", [found, isDark, room], () => {
    put("scene", {}, found.words);
    const look = theme(isDark);
    const width = Math.max(300, Math.min(room, 460));
    const shown = described(found.panels, look);
    const { left, right } = frames(shown, width);
    const scaled = shown.map((panel) => {
      const ratio = (panel.y.high - panel.y.low) / (panel.x.high - panel.x.low);
      return { ...panel, height: Math.max(30, (right - left) * ratio) };
    });
    const title = "The sphere from the side, to scale, and the contact circle from above";
    const about = { id: "contact", width, theme: look, title, description: found.words };
    put("contact", { hidden: !shown.length }, ...(shown.length ? [figure(scaled, about)] : []));
  });
}
