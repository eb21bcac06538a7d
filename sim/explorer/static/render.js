// The page that belongs to a state. Controls are made once and then follow the state; figures are drawn anew.

import { current, differences, isCurrent, isDescribed, nameOfRun } from "./answer.js";
import { built, diverging, figure, frames, h, axisOf, placed, ticked } from "./figure.js";
import { picture, ratio, reading } from "./live.js";
import { digits, engineering, greek, lettered, scaled } from "./notation.js";
import { COLOURS, curvesOf, describedOf, panels, tableOf } from "./panels.js";
import { hasEnded, isFitted, isOriginal, placeOf, same, textOf } from "./state.js";

/** @typedef {import("./state.js").State} State */
/** @typedef {import("./state.js").Slider} Slider */
/** @typedef {import("./figure.js").Theme} Theme */
/** @typedef {import("./figure.js").Mark} Mark */

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
const GROUPS = [
  ["Load and mount", ["contact"]],
  ["Drive", ["drive"]],
  ["Bonds", ["bonds"]],
  ["Fluctuations", ["shear"]],
  ["Solids and adhesion", []],
];

/** @param {string} id
 * @returns {any} */
export const $ = (id) => document.getElementById(id);

/** Return an element with a text and attributes.
 * @param {string} name
 * @param {string} text
 * @param {Record<string, any>} attributes
 * @returns {any} */
export function element(name, text = "", attributes = {}) {
  const result = document.createElement(name);
  result.textContent = text;
  for (const [key, value] of Object.entries(attributes)) result.setAttribute(key, value);
  return result;
}

/** Make the controls of a scenario.
 * @param {State} state */
export function build({ start }) {
  $("title").textContent = document.title = start.title;
  $("question").textContent = start.question;
  for (const name of start.figures) {
    const label = element("label");
    label.append(element("input", "", { type: "radio", name: "figure", value: name }), ` ${NAMES[name]}`);
    $("figures").append(label);
  }
  const groups = new Map(GROUPS.map(([title]) => [title, /** @type {Slider[]} */ ([])]));
  for (const slider of start.sliders) {
    const first = slider.key.split(".")[0];
    const [title] = GROUPS.find(([, tables]) => tables.includes(first)) ?? GROUPS[GROUPS.length - 1];
    groups.get(title)?.push(slider);
  }
  for (const [title, sliders] of groups) {
    if (!sliders.length) continue;
    const group = element("details", "", { open: "" });
    group.append(element("summary", String(title)), ...sliders.map(control));
    $("groups").append(group);
  }
  start.points.forEach((point, place) => {
    const words = Object.entries(point).map(([key, value]) => {
      const { symbol, unit } = /** @type {Slider} */ (start.sliders.find((slider) => slider.key === key));
      return `${symbol ? lettered(symbol).join("") : key} = ${engineering(value, unit)}`;
    });
    if (!place) $("point").append(element("option", "none of them", { value: "" }));
    $("point").append(element("option", words.join(", "), { value: place }));
  });
  $("points").hidden = !start.points.length;
  for (const { key, name } of start.mechanisms) {
    const label = element("label");
    label.append(element("input", "", { type: "checkbox", value: key }), ` ${name}`);
    $("mechanisms").append(label);
  }
  $("mechanisms").hidden = !start.mechanisms.length;
  for (const { key } of start.sliders) {
    const label = element("label");
    label.append(element("input", "", { type: "checkbox", value: key }), ` ${key}`);
    $("free").append(label);
  }
  if (start.preview.length) {
    const reasons = start.preview.join(", and ");
    $("preview").textContent =
      `Preview: steady sliding is not what this scenario computes, because ${reasons}. Choose the motion, or run the scenario's own models.`;
  }
  $("members").value = Math.max(2, start.members);
}

/** @param {Slider} slider */
function control(slider) {
  const { key, meaning, symbol, marked } = slider;
  const box = element("div", "", { class: "slider" });
  const label = element("label", `${marked ? "★ " : ""}${meaning}${symbol ? ", " : ""}`, { for: key });
  const [letter, index] = lettered(symbol);
  label.append(letter, element("sub", index), " ", element("small", key));
  const range = element("input", "", { type: "range", id: key, min: 0, max: STEPS, step: 1 });
  const name = `${meaning}, with its unit`;
  const text = element("input", "", {
    type: "text",
    id: `text ${key}`,
    "aria-label": name,
    autocomplete: "off",
    spellcheck: "false",
  });
  const track = element("div", "", { class: "track" });
  track.append(range);
  box.append(label, track, text, element("p", "", { id: `fault ${key}`, class: "fault", role: "alert", hidden: "" }));
  if (slider.over_wavelength) {
    const choice = element("select", "", { id: "meaning", "aria-label": "What the length is" });
    choice.append(element("option", "correlation length", { value: "" }));
    choice.append(element("option", "wavelength of the same energy", { value: "1" }));
    label.append(" ", choice);
  }
  return box;
}

/** Return the colours of figures.
 * @param {boolean} isDark
 * @returns {Theme} */
export const theme = (isDark) =>
  isDark
    ? { ink: "#e8e8e8", soft: "#b0b0b0", grid: "#33363b", back: "#16181b" }
    : { ink: "#1a1a1a", soft: "#595959", grid: "#e4e4e4", back: "#ffffff" };

/** Show a state.
 * @param {State} state
 * @param {{ isDark: boolean, isNarrow: boolean }} screen */
export function render(state, screen) {
  const { trouble, past, future, view } = state;
  $("main").hidden = false;
  say("trouble", trouble);
  $("undo").disabled = !past.length;
  $("redo").disabled = !future.length;
  $("reset").disabled = isOriginal(state) && !state.refusal;
  for (const item of document.querySelectorAll("#figures input")) {
    const radio = /** @type {HTMLInputElement} */ (item);
    radio.checked = radio.value === view.figure;
    /** @type {HTMLElement} */ (radio.parentElement).hidden = radio.value === "data" && !state.table;
  }
  $("figures").hidden = document.querySelectorAll("#figures label:not([hidden])").length < 2;
  for (const name of /** @type {const} */ (["absolute", "first", "loads"])) $(name).checked = view[name];
  const level = Math.round(100 * view.share);
  if (document.activeElement !== $("level") || !state.dragging) $("level").value = level;
  $("level").setAttribute("aria-valuetext", `${level} %`);
  $("percent").textContent = `${level} %`;
  $("view").hidden = view.figure === "motion" || isDescribed(state);
  $("preview").hidden = $("view").hidden || !state.start.preview.length;
  for (const slider of state.start.sliders) follow(state, slider);
  for (const item of document.querySelectorAll("#mechanisms input")) {
    const box = /** @type {HTMLInputElement} */ (item);
    box.checked = state.values[box.value] !== 0;
  }
  // of one mechanism alone there is no order
  $("first").parentElement.hidden = !["lost_to_bonds", "lost_to_fluctuations"].every((name) =>
    curvesOf(state)?.curves[name]?.some((/** @type {number} */ lost) => lost > 1e-6),
  );
  const place = state.start.points.findIndex((point) =>
    Object.entries(point).every(([key, value]) => state.values[key] === value),
  );
  $("point").value = place < 0 ? "" : String(place);
  words(state);
  job(state);
  data(state);
  plot(state, screen);
  contact(state, screen);
}

/** Show a text, or hide its place.
 * @param {string} id
 * @param {string} text */
function say(id, text) {
  $(id).hidden = !text;
  if ($(id).textContent !== text) $(id).textContent = text;
}

/** Bring a slider to the state.
 * @param {State} state
 * @param {Slider} slider */
function follow(state, slider) {
  const { key } = slider;
  const [range, text, fault] = [$(key), $(`text ${key}`), $(`fault ${key}`)];
  const words = textOf(state, slider);
  const place = placeOf(slider, state.values[key], STEPS);
  if (Number(range.value) !== place) range.value = place;
  range.setAttribute("aria-valuetext", words);
  const refusal = state.refusal?.key === key ? state.refusal : null;
  const isTyped = document.activeElement === text && text.value !== text.dataset.shown;
  if (!isTyped) text.value = text.dataset.shown = refusal?.typed ? refusal.text : words;
  text.setAttribute("aria-invalid", String(Boolean(refusal)));
  if (refusal) text.setAttribute("aria-errormessage", `fault ${key}`);
  else text.removeAttribute("aria-errormessage");
  say(`fault ${key}`, refusal ? `“${refusal.text}” ${refusal.reason}; ${words} stays in use` : "");
  fault.hidden = !refusal;
  interval(state, slider, range.parentElement);
}

/** Draw the 95 % interval of a number that was fitted, as long as the state has the numbers of the fit.
 * @param {State} state
 * @param {Slider} slider
 * @param {HTMLElement} track */
function interval(state, slider, track) {
  const number = isFitted(state) ? state.fit?.answer.numbers[slider.key] : null;
  const known = number && [number.low, number.high].every(Number.isFinite);
  const old = track.querySelector("svg");
  if (!known) return void old?.remove();
  const [from, to] = [number.low, number.high].map((end) => Math.min(STEPS, Math.max(0, placeOf(slider, end, STEPS))));
  const bar = h("rect", { x: from, y: 0, width: Math.max(2, to - from), height: 4 });
  const drawn = built(
    h(
      "svg",
      { viewBox: `0 0 ${STEPS} 4`, preserveAspectRatio: "none", role: "img", "aria-label": "95 % interval of the fit" },
      bar,
    ),
  );
  if (old) old.replaceWith(drawn);
  else track.append(drawn);
}

/** Return the numbers to which the figure that is drawn belongs.
 * @param {State} state */
function valuesOf(state) {
  if (state.view.figure === "motion") return state.motion.pieces.at(-1)?.of;
  return (isDescribed(state) ? describedOf(state) : state.answers.curves)?.of.values;
}

/** Return the sentence of curves.
 * @param {State} state */
const wordsOf = (state) => (isDescribed(state) ? describedOf(state)?.answer.words : curvesOf(state)?.level.words) ?? "";

/** Show the sentences. Those on earlier numbers are grey until new ones arrive.
 * @param {State} state */
function words(state) {
  const { view } = state;
  $("lost").textContent = view.figure === "motion" ? course(state) : wordsOf(state);
  $("lost").dataset.of = JSON.stringify(valuesOf(state));
  const found = state.answers.words;
  const { pin } = state;
  const at = pin ? differences(state, pin.of.values) : "";
  say("pinned", pin ? `Pinned${at ? ` at ${at}` : " here"}: ${pin.answer.level.words}` : "");
  $("pin").textContent = pin ? "Unpin" : "Pin";
  $("pin").setAttribute("aria-pressed", String(Boolean(pin)));
  for (const id of ["diagnosis", "remarks"]) {
    const lines = found?.answer[id] ?? [];
    const old = [...$(id).children].map((item) => item.textContent);
    if (!same(old, lines)) $(id).replaceChildren(...lines.map((/** @type {string} */ line) => element("li", line)));
    $(id).classList.toggle("earlier", !isCurrent(state, "words"));
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

/** Show the job, its end, and a trace.
 * @param {State} state */
function job(state) {
  const { run } = state;
  $("stop").disabled = !state.job;
  $("progress").hidden = !state.job;
  $("progress").value = state.job?.done ?? 0;
  let text = state.report;
  if (state.job) text = state.job.left ? `${state.job.left} left` : "";
  else if (!text && run) {
    const { members, along } = run.answer;
    const other = differences(state, run.of.values);
    const many = members > 1 ? `${members} members: mean and 95 % interval` : "all members are equal: one of them";
    const mean = members > 1 ? `mean of ${members} members with its 95 % interval` : "all members are equal";
    const name = along === "t" ? `${mean}: ${run.answer.words}` : `${many} in the figure over the speed`;
    text = other ? `${name}; of earlier numbers: ${nameOfRun(state)}` : name;
  } else if (!text) text = current(state, "band")?.reason ?? "";
  if ($("ran").textContent !== text) $("ran").textContent = text;
}

/** Show how well the curves fit the points, and the last fit.
 * @param {State} state */
function data(state) {
  const { fit, table } = state;
  const found = curvesOf(state)?.data;
  $("free").hidden = !table;
  $("fit").disabled = $("plan").disabled = !table || Boolean(state.job);
  if (found) say("judged", `${found.name}: ${found.words}`);
  else if (!$("judged").dataset.fault) say("judged", "");
  $("fitted").hidden = !fit;
  if (!fit) return;
  const isPresent = isFitted(state);
  $("fitted").classList.toggle("earlier", !isPresent);
  say("earlier", isPresent ? "" : "This fit is of earlier numbers or another table.");
  $("use").hidden = isPresent;
  $("fitted").querySelector("pre").textContent = [fit.answer.text, ...fit.answer.remarks].join("\n");
}

/** The panels that are drawn, for reading and saving.
 * @type {{ shown: import("./figure.js").Panel[], node: import("./figure.js").Node | null, width: number, shared: boolean }} */
export const drawn = { shown: [], node: null, width: 0, shared: true };

/** @type {Map<string, any[]>} */
const seen = new Map();

/** Return true if any part of what is drawn is another one than at the last call of a name.
 * @param {string} name
 * @param {any[]} parts */
function isNew(name, parts) {
  const before = seen.get(name);
  seen.set(name, parts);
  return !before || parts.some((part, k) => part !== before[k]);
}

/** Draw the figure. While the curves of a move are under way all of it stays that of the numbers before.
 * @param {State} state
 * @param {{ isDark: boolean, isNarrow: boolean }} screen */
function plot(state, { isDark, isNarrow }) {
  const look = theme(isDark);
  const isMotion = state.view.figure === "motion";
  $("live").hidden = !isMotion;
  const { answers, motion, view, run, pin, reading: place } = state;
  const { curves, before, others, band, shown: described } = answers;
  const looks = [isDark, isNarrow, $("plot").clientWidth, $("numbers").open];
  const parts = [
    curves,
    before,
    others,
    band,
    described,
    motion.columns,
    motion.pieces,
    view,
    run,
    pin,
    place,
    ...looks,
  ];
  if (!isNew("plot", parts)) {
    if (isMotion && drawn.node) now(state, { isDark });
    return;
  }
  const shown = panels(state, look, isNarrow);
  drawn.shown = shown;
  if (!shown.length) {
    drawn.node = null;
    $("reader").hidden = true;
    $("plot").replaceChildren();
    return;
  }
  /** @type {ReturnType<typeof tableOf>} */
  const table = describedOf(state)?.answer.table ?? tableOf(panels(state, look, false));
  $("reader").hidden = !table.rows.length;
  drawn.width = Math.max(300, $("plot").clientWidth);
  drawn.shared = isMotion ? !motion.columns.normal_load : !["data", "map"].includes(view.figure);
  const mark = readAt(state, shown, table);
  const name = `${state.start.title}: ${NAMES[view.figure]}`;
  const description = $("lost").textContent;
  const about = { width: drawn.width, theme: look, title: name, description, shared: drawn.shared };
  const isRead = (/** @type {import("./figure.js").Panel} */ { x }) => mark && x.label === shown[0].x.label;
  const read = shown.map((panel) => (isRead(panel) ? { ...panel, marks: [...panel.marks, mark] } : panel));
  drawn.node = figure(/** @type {import("./figure.js").Panel[]} */ (read), about);
  $("plot").replaceChildren(built(drawn.node));
  // a figure that is higher than a small screen would hide what is below it if it stayed in sight
  $("plot").classList.toggle("tall", Number(drawn.node.attributes.height) > 330);
  $("plot").dataset.of = JSON.stringify(valuesOf(state));
  $("plot").dataset.share = state.answers.curves?.of.share;
  if ($("numbers").open) {
    const head = element("tr");
    head.append(...table.head.map((text) => element("th", text, { scope: "col" })));
    const rows = table.rows.map((row) => {
      const line = element("tr");
      line.append(...row.map((value) => element("td", value === null ? "–" : digits(value))));
      return line;
    });
    const whole = element("table");
    whole.append(head, ...rows);
    $("numbers").querySelector("div").replaceChildren(whole);
  }
  if (isMotion) now(state, { isDark });
}

/** Show the numbers at the reading point, and return its line in the figure.
 * @param {State} state
 * @param {import("./figure.js").Panel[]} shown
 * @param {{ head: string[], rows: (number | null)[][] }} table
 * @returns {Mark | null} */
function readAt(state, shown, table) {
  const last = table.rows.length - 1;
  $("at").max = String(last);
  const place = Math.min(last, state.reading ?? 0);
  if (Number($("at").value) !== place) $("at").value = String(place);
  const row = table.rows[place] ?? [];
  const { left, right } = frames(shown, drawn.width, drawn.shared);
  $("at").style.width = `${right - left + 16}px`;
  const words = table.head.map((text, k) => {
    const [, name, unit = ""] = /^(.*?)(?: \((.*)\))?$/.exec(text) ?? [];
    const value = row[k] === null || row[k] === undefined ? "–" : ticked(Number(digits(Number(row[k]))));
    return `${name} ${value} ${unit}`.trim();
  });
  $("at").setAttribute("aria-valuetext", words.join("; "));
  const text = state.reading === null ? "" : words.join(" · ");
  if ($("reading").textContent !== text) $("reading").textContent = text;
  if (state.reading === null || row[0] === null || row[0] === undefined) return null;
  return { kind: "rule", x: [row[0]], y: [], colour: COLOURS.own, width: 1, dash: "2 3", name: "reading" };
}

/** Pictures of maps, by the answer with the mean stress, and by its map without it.
 * @type {WeakMap<object, { href: string, side: number, most: number }>} */
const maps = new WeakMap();

/** Return a map of the stress as a picture, in which white is a given stress.
 * @param {any} found
 * @param {number} middle */
function mapOf(found, middle) {
  const known = maps.get(middle ? found.stress : found);
  if (known) return known;
  const stress = found.stress.map((/** @type {number[]} */ row) => row.map((value) => value - middle));
  const size = stress.length;
  const most = Math.max(...stress.flat().map(Math.abs)) || 1;
  const canvas = element("canvas", "", { width: size, height: size });
  const pen = canvas.getContext("2d");
  const image = pen.createImageData(size, size);
  // rows of the map run along the sliding direction, rows of the picture from above to below
  for (let x = 0; x < size; x += 1) {
    for (let y = 0; y < size; y += 1) {
      image.data.set([...diverging(stress[x][y] / most), 255], 4 * ((size - 1 - y) * size + x));
    }
  }
  pen.putImageData(image, 0, 0);
  const result = { href: canvas.toDataURL(), side: found.side, most };
  maps.set(middle ? found.stress : found, result);
  return result;
}

/** Return the map of the fluctuations alone, with their energy, for the picture of the motion.
 * @param {any} found */
function waves(found) {
  if (!found?.stress || !(found.fluctuation_energy > 0)) return null;
  const all = found.stress.flat();
  const mean = all.reduce((/** @type {number} */ sum, /** @type {number} */ value) => sum + value, 0) / all.length;
  return { ...mapOf(found, mean), energy: found.fluctuation_energy };
}

/** Draw the moment of the motion.
 * @param {State} state
 * @param {{ isDark: boolean }} screen */
export function now(state, { isDark }) {
  const look = theme(isDark);
  const { motion } = state;
  const width = Math.max(300, $("live").clientWidth);
  const map = waves(current(state, "contact"));
  $("waves").hidden = !map;
  $("scene-live").replaceChildren(built(picture(state, look, width, map)));
  $("moment").textContent = reading(state) + (motion.note ? ` · ${motion.note}` : "");
  const ended = hasEnded(motion, state.start);
  $("play").textContent = ended ? "Play again" : motion.paused ? "Play" : "Pause";
  if (!drawn.node || !$("plot").firstElementChild) return;
  const { left, right, rows } = frames(drawn.shown, drawn.width, drawn.shared);
  const marks = drawn.shown.flatMap((panel, k) => {
    const [top, bottom] = rows[k];
    const loop = panel.marks.find(({ name }) => name === "loop");
    if (loop) {
      const { x, y } = loop;
      const place = Math.min(
        x.length - 1,
        motion.columns.t.findLastIndex((t) => Number(t) <= motion.time),
      );
      const [across, along] = [x[place], y[place]];
      if (across === null || along === null || across === undefined || along === undefined) return [];
      return [
        h("circle", {
          cx: placed(panel.x, left, right)(across),
          cy: placed(panel.y, bottom, top)(along),
          r: 5,
          fill: COLOURS.fluctuations,
        }),
      ];
    }
    const [factor] = scaled(state.start.duration, "s");
    const across = placed(panel.x, left, right)(motion.time * factor).toFixed(1);
    return [h("path", { d: `M${across} ${top}V${bottom}`, stroke: COLOURS.fluctuations, "stroke-width": 1.5 })];
  });
  const svg = $("plot").firstElementChild;
  svg.querySelector(".now")?.remove();
  svg.append(built(h("g", { class: "now" }, ...marks)));
}

/** Show the ratio of the motion to real time, and the choices.
 * @param {State} state
 * @param {number} rate that was reached */
export function rates({ motion, start }, rate) {
  if (!$("rate").options.length) {
    for (const factor of [10, 10 / 3, 1, 1 / 3, 0.1]) {
      $("rate").append(element("option", ratio(motion.rate * factor), { value: motion.rate * factor }));
    }
  }
  const options = /** @type {HTMLOptionElement[]} */ ([...$("rate").options]);
  options.forEach((option) => (option.selected = Math.abs(Number(option.value) / motion.rate - 1) < 1e-6));
  const isMoving = !motion.paused && !hasEnded(motion, start);
  const text = isMoving && rate > 0 ? `now ${ratio(rate)}` : "";
  if ($("ratio").textContent !== text) $("ratio").textContent = text;
}

/** Draw the sphere on the half-space from the side, and the contact from above.
 * @param {State} state
 * @param {{ isDark: boolean }} screen */
function contact(state, { isDark }) {
  const found = current(state, "contact");
  $("contact").classList.toggle("earlier", !found);
  $("scene").classList.toggle("earlier", !found);
  if (!found || !isNew("contact", [found, isDark, $("words").clientWidth])) return;
  const { radius, speed } = found;
  const map = found.stress ? mapOf(found, 0) : null;
  const colours = map
    ? `; blue is −${engineering(map.most, "Pa")} and red +${engineering(map.most, "Pa")} of one realisation of the shear stress`
    : "";
  $("scene").textContent = radius
    ? `In steady sliding at ${engineering(speed, "m/s")}: contact radius ${engineering(radius, "m")}. Above: a cut through sphere and half-space, heights and widths to one scale. Below: the contact circle; dotted: JKR's circle${colours}.`
    : "In steady sliding the contact is open.";
  $("contact").hidden = !radius;
  if (!radius) return;
  const look = theme(isDark);
  const half = found.side / 2;
  const [factor, unit] = scaled(half, "m");
  const scale = (/** @type {number[]} */ values) => values.map((value) => value * factor);
  const round = Array.from({ length: 181 }, (_, k) => (k * Math.PI) / 90);
  /** @type {(size: number, dash?: string) => Mark} */
  const circle = (size, dash = "") => ({
    kind: "line",
    x: scale(round.map((angle) => size * Math.cos(angle))),
    y: scale(round.map((angle) => size * Math.sin(angle))),
    colour: map ? "#1a1a1a" : look.ink,
    width: dash ? 1 : 2,
    dash,
  });
  const ends = scale([-half, half]);
  const width = Math.max(300, Math.min($("words").clientWidth, 460));
  const wide = { label: `along the sliding direction (${unit})`, low: ends[0], high: ends[1], log: false };
  const heights = scale([...found.surface, ...found.sphere]);
  const [low, high] = [Math.min(...heights), Math.max(...heights)];
  const across = width - 62 - 14;
  /** @type {import("./figure.js").Panel[]} */
  const shown = [
    {
      x: wide,
      y: { ...axisOf(`z (${unit})`, [[low, high]]), low, high },
      height: Math.max(30, (across * (high - low)) / (ends[1] - ends[0])),
      marks: [
        { kind: "line", x: scale(found.x), y: scale(found.surface), colour: COLOURS.rest },
        { kind: "line", x: scale(found.x), y: scale(found.sphere), colour: look.ink },
      ],
    },
    {
      x: wide,
      y: { ...wide, label: `across (${unit})` },
      height: across,
      marks: [
        ...(map ? [/** @type {Mark} */ ({ kind: "image", x: ends, y: ends, colour: "", name: map.href })] : []),
        circle(radius),
        ...(found.jkr_radius ? [circle(found.jkr_radius, "2 4")] : []),
      ],
    },
  ];
  const about = { width, theme: look, title: "The contact", description: $("scene").textContent };
  const node = figure(shown, about);
  // ids belong to the main figure
  const svg = /** @type {Element} */ (built(node));
  svg.querySelectorAll("[id^=figure]").forEach((item) => item.removeAttribute("id"));
  svg.querySelectorAll("clipPath").forEach((item) => (item.id = `contact-${item.id}`));
  svg
    .querySelectorAll("[clip-path]")
    .forEach((item) => item.setAttribute("clip-path", `${item.getAttribute("clip-path")}`.replace("#", "#contact-")));
  svg.removeAttribute("aria-labelledby");
  svg.setAttribute("aria-label", "The sphere from the side, to scale, and the contact circle from above");
  $("contact").replaceChildren(svg);
}
