// The page of `sim explore`: gestures change the state, the state asks the server, and the page is drawn from the state.
// All physics is computed by Python.

import { ADDRESSES, LATE, QUESTIONS, due, isCurrent, isDescribed } from "./answer.js";
import { ask, authorised, shareable, store, stored, stream } from "./connection.js";
import { $, put, written } from "./node.js";
import { STEPS, drawn, isTyped, now, render } from "./render.js";
import * as change from "./state.js";

/** @typedef {import("./state.js").State} State */

const narrow = matchMedia("(max-width: 800px)");
const dark = matchMedia("(prefers-color-scheme: dark)");
const quiet = matchMedia("(prefers-reduced-motion: reduce)");
/** @type {import("./render.js").Screen} */
const screen = { isDark: false, isNarrow: false, plot: 0, words: 0, reached: 0 };

/** @type {State} */
let state;
/** Number of the frame in which the state will be drawn, 0 if it is drawn. */
let frame = 0;
let address = "";
/** Number of the gestures that take back what a text is read for. */
let epoch = 0;
/** Answers under way, by their names.
 * @type {Map<string, Promise<any>>} */
const asked = new Map();
/** @type {AbortController | null} */
let stopper = null;
/** Questions that could not be answered, by their names. They are not asked again.
 * @type {Map<string, any>} */
const failed = new Map();

// tests look at the state
Object.defineProperty(globalThis, "explored", { get: () => state });

/** Show a message of the whole page.
 * @param {unknown} fault */
function complain(fault) {
  const text = fault instanceof Error ? fault.message : String(fault);
  if (state) update({ ...state, trouble: text });
  else put("trouble", { hidden: false }, text);
}

/** Take the next state, draw it within a frame, and ask for what it lacks.
 * @param {State} next */
function update(next) {
  if (next === state) return;
  state = next;
  frame ||= requestAnimationFrame(draw);
  const names = due(state).filter((name) => !change.same(failed.get(name), QUESTIONS[name](state)));
  // one after the other, so that they take no time from curves that are asked for meanwhile
  const late = names.find((name) => LATE.includes(name));
  names.filter((name) => name === late || !LATE.includes(name)).forEach(answer);
  move();
}

function draw() {
  cancelAnimationFrame(frame);
  frame = 0;
  render(state, screen);
  // after the frame
  if (!state.dragging && isCurrent(state, "curves")) setTimeout(remember);
}

/** Take the size of the page. It is measured only when it changes, because a width that is read between changes of the
 * page makes the browser lay it out at once. */
function measure() {
  const [plot, words] = [$("plot").clientWidth, $("words").clientWidth];
  const next = { isDark: dark.matches, isNarrow: narrow.matches, plot, words };
  if (change.same({ ...screen, ...next }, screen)) return;
  Object.assign(screen, next);
  if (state) frame ||= requestAnimationFrame(draw);
}

/** Ask a question, unless its name is under way or it could not be answered, and take the answer.
 * @param {string} name
 * @param {any} question
 * @param {(found: any) => void} take
 * @param {any} key of the question, if another one would fail alike */
function request(name, question, take, key = question) {
  if (asked.has(name) || change.same(failed.get(name), key)) return;
  const reply = ask(ADDRESSES.get(name) ?? name, question);
  asked.set(name, reply);
  reply
    .then(async (found) => {
      // numbers that the curves refuse are no longer those of the state
      if (name === "shown") await asked.get("curves");
      asked.delete(name);
      take(found);
    })
    .catch((fault) => {
      failed.set(name, key);
      asked.delete(name);
      complain(fault);
    });
}

/** Ask for the answer of a name; what is changed meanwhile is asked after it.
 * @param {string} name */
function answer(name) {
  const question = QUESTIONS[name](state);
  request(name, question, (found) => {
    update(change.answered(state, name, question, found));
    if (name === (isDescribed(state) ? "shown" : "curves")) draw(); // at once, not in the next frame
  });
}

/** Ask for the next part of the motion. */
function move() {
  const part = change.nextOfMotion(state);
  if (!part) return;
  const take = (/** @type {any} */ found) => {
    if (found.faults) failed.set("motion", part.values);
    else if (state.view.figure === "motion") {
      update(change.continued(state, part, found));
      if (!part.run && !state.motion.paused) play();
    }
  };
  request("motion", part, take, part.values);
}

let last = 0;
let isPlaying = false;
/** @type {[number, number][]} */
let passed = [];

/** Show the motion until it ends or is stopped. */
function play() {
  if (isPlaying) return;
  isPlaying = true;
  last = performance.now();
  passed = [];
  requestAnimationFrame(tick);
}

/** @param {number} time */
function tick(time) {
  const { motion, view, start } = state;
  isPlaying = !motion.paused && view.figure === "motion" && !change.hasEnded(motion, start);
  if (!isPlaying) return draw();
  state = change.played(state, Math.max(0, Math.min(0.1, (time - last) / 1000)));
  last = time;
  passed = [...passed.filter(([then]) => time - then < 1000), [time, state.motion.time]];
  const [[from, first]] = passed;
  screen.reached = time - from > 300 ? (state.motion.time - first) / ((time - from) / 1000) : 0;
  if (!frame) now(state, screen);
  requestAnimationFrame(tick);
}

// The address

/** Write the numbers that differ from the scenario into the address. */
function remember() {
  const words = new URLSearchParams(change.words(state)).toString();
  if (words === address && location.hash === (words && `#${words}`)) return;
  address = words;
  history.replaceState(null, "", `${location.pathname}${words ? `#${words}` : ""}`);
}

addEventListener("hashchange", () => {
  epoch += 1;
  authorised(hash());
  update(change.linked(state, hash()));
});
const hash = () => new URLSearchParams(location.hash.slice(1));

addEventListener("pagehide", () => {
  if (!state) return;
  const { table, run, fit, pin, past, future } = state;
  store({ stamp: state.start.stamp, table, state: { run, fit, pin, past, future } });
});

// Sliders

/** @param {string} key */
const sliderOf = (key) =>
  /** @type {import("./state.js").Slider} */ (state.start.sliders.find((slider) => slider.key === key));

/** Read a text with a unit, or a bare number in the unit that is shown. A text that cannot be read leaves the value.
 * @param {string} key
 * @param {string} text */
async function read(key, text) {
  const began = epoch;
  const field = $(`text ${key}`);
  const number = text.trim().replace(",", ".");
  const isBare = number !== "" && Number.isFinite(Number(number));
  const [, ...unit] = change.textOf(state, sliderOf(key)).split(" ");
  const words = isBare ? [number, ...unit].join(" ") : text;
  field.setAttribute("aria-busy", "true");
  try {
    const found = await ask("curves", { values: { ...state.values, [key]: words } });
    // the field follows the state again, unless more was written meanwhile
    if (field.value === text) field.dataset.shown = text;
    if (epoch !== began) return update({ ...state });
    if (found.faults) {
      const reason = found.faults[key] ?? Object.values(found.faults).join("; ");
      return update(change.refused(state, key, text, reason));
    }
    const factor = state.wavelength ? (sliderOf(key).over_wavelength ?? 1) : 1;
    const value = found.values[key] * factor;
    if (value !== state.values[key]) update(change.moved(state, { [key]: value }));
    else update({ ...state, refusal: null });
  } catch (fault) {
    complain(fault);
  } finally {
    field.removeAttribute("aria-busy");
  }
}

/** Return the state after a control was changed, by its name or its id.
 * @type {Record<string, (control: any) => State>} */
const CHANGES = {
  figure: ({ value }) => change.viewed(state, { figure: value }),
  absolute: ({ checked }) => change.viewed(state, { absolute: checked }),
  first: ({ checked }) => change.viewed(state, { first: checked }),
  loads: ({ checked }) => change.viewed(state, { loads: checked }),
  meaning: ({ value }) => ({ ...state, wavelength: value !== "" }),
  rate: ({ value }) => change.withMotion(state, { rate: Number(value) }),
  mechanism: ({ value, checked }) => {
    const full = state.start.mechanisms.find(({ key }) => key === value)?.on ?? 1;
    return change.moved(state, { [value]: checked ? full : 0 });
  },
  point: ({ value }) => (value === "" ? { ...state } : change.moved(state, state.start.points[Number(value)])),
};

/** @param {string} id
 * @param {string} kind
 * @param {(event: any) => void} act */
const on = (id, kind, act) => $(id).addEventListener(kind, act);

/** Listen to the controls, of which there may be many, in one place. */
function listen() {
  const isGesture = (/** @type {any} */ item) => item.type === "range" && item.id !== "at";
  on("main", "pointerdown", ({ target }) => isGesture(target) && update(change.released(state)));
  on("main", "focusout", ({ target }) => isGesture(target) && state.gesture && update(change.released(state)));
  on("main", "input", ({ target }) => {
    const [key, place] = [target.id, Number(target.value)];
    if (key === "at") update({ ...state, reading: place });
    else if (key === "level") update(change.viewed(state, { share: place / 100 }, key));
    else if (isGesture(target))
      update(change.moved(state, { [key]: change.valueAt(sliderOf(key), place, STEPS) }, key));
  });
  on("main", "change", ({ target }) => {
    const act = CHANGES[target.name || target.id];
    if (act) update(act(target));
    else if (isGesture(target)) update(change.rested(state));
    else if (target.id.startsWith("text ")) read(target.id.slice(5), target.value);
  });
}

/** Take back what is still under way, then change the state.
 * @param {(state: State) => State} transition */
function turn(transition) {
  epoch += 1;
  update(transition(state));
}
on("undo", "click", () => turn(change.undone));
on("redo", "click", () => turn(change.redone));
on("reset", "click", () => turn(change.reset));
addEventListener("keydown", (event) => {
  const { key, target } = event;
  const field = /** @type {any} */ (target);
  if (!(event.ctrlKey || event.metaKey) || (field?.type === "text" && isTyped(field))) return;
  const isRedo = key === "y" || (key.toLowerCase() === "z" && event.shiftKey);
  if (!isRedo && key !== "z") return;
  event.preventDefault();
  turn(isRedo ? change.redone : change.undone);
});

// The figure

on("pin", "click", () => update(change.pinned(state)));
on("plot", "click", ({ target }) => {
  const point = state.answers.shown?.answer.plays?.[target.dataset.name];
  if (point) update(change.begun(state, point));
});
on("numbers", "toggle", () => update({ ...state }));
on("play", "click", () => {
  const { motion, start } = state;
  if (change.hasEnded(motion, start)) update(change.withMotion(state, { time: 0, paused: false }));
  else update(change.withMotion(state, { paused: !motion.paused }));
  if (!state.motion.paused) play();
});
on("step", "click", () => {
  const { motion, start } = state;
  const ended = change.hasEnded(motion, start);
  const paused = change.withMotion(state, { paused: true, time: ended ? 0 : motion.time });
  update(change.played(paused, start.duration / 20 / motion.rate));
});
dark.addEventListener("change", measure);

// Jobs: the scenario's own models, and fits

/** Run a job, whose result belongs to the numbers with which it was begun.
 * @param {any} request */
async function job(request) {
  stopper?.abort();
  const mine = (stopper = new AbortController());
  update({ ...state, job: { task: request.task, done: 0, left: "" }, report: "" });
  let report = "";
  try {
    await stream(request, mine.signal, ({ done, left = "", fault, result }) => {
      if (mine !== stopper) return;
      if (fault) throw new Error(fault);
      if (result) update(change.finished(state, request, result));
      else update({ ...state, job: { task: request.task, done, left } });
    });
  } catch (fault) {
    report = mine.signal.aborted ? "stopped" : String(/** @type {Error} */ (fault).message);
  }
  if (mine === stopper && (report || state.job)) update({ ...state, job: null, report });
}

on("own", "submit", (event) => {
  event.preventDefault();
  const members = Number($("members").value);
  if (!Number.isInteger(members) || members < 1 || members > 100000) {
    return update({ ...state, report: "write a whole number of members between 1 and 100000" });
  }
  job({ task: "ensemble", values: state.values, members });
});
on("stop", "click", () => stopper?.abort());
/** Begin a fit or the plan of a measurement.
 * @param {string} task */
function compare(task) {
  const ticked = /** @type {NodeListOf<HTMLInputElement>} */ (document.querySelectorAll("#free input:checked"));
  const free = [...ticked].map(({ value }) => value);
  put("unfit", {}, free.length ? "" : "tick the numbers to fit");
  if (free.length) job({ task, values: state.values, data: state.table, free });
}
on("data", "submit", (event) => {
  event.preventDefault();
  compare("fit");
});
on("plan", "click", () => compare("plan"));
on("use", "click", () => update(change.withFit(state)));

/** Show a table of measured curves.
 * @param {File} file */
async function load(file) {
  try {
    const { data } = await ask("data", { name: file.name, text: await file.text() });
    update(change.tabled(state, data));
  } catch (fault) {
    update({ ...state, unread: /** @type {Error} */ (fault).message });
  }
}
on("file", "change", () => $("file").files[0] && load($("file").files[0]));
addEventListener("dragover", (event) => {
  event.preventDefault();
  document.body.classList.add("over");
});
addEventListener("dragleave", () => document.body.classList.remove("over"));
addEventListener("drop", (event) => {
  event.preventDefault();
  document.body.classList.remove("over");
  const file = event.dataTransfer?.files[0];
  if (file) load(file);
});

// What is taken away

/** Return the figure as it is seen, as a file.
 * @param {string} kind
 * @returns {Promise<Blob>} */
async function pictured(kind) {
  if (!drawn.node) throw new Error("there is no figure yet");
  const vector = new Blob([written(drawn.node)], { type: "image/svg+xml" });
  if (kind === "svg") return vector;
  const image = new Image();
  image.src = URL.createObjectURL(vector);
  await image.decode();
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [3 * image.width, 3 * image.height];
  const pen = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  pen.drawImage(image, 0, 0, canvas.width, canvas.height);
  URL.revokeObjectURL(image.src);
  return new Promise((done, fail) =>
    canvas.toBlob((blob) => (blob ? done(blob) : fail(new Error("no picture"))), "image/png"),
  );
}

on("save", "click", async ({ target }) => {
  const { kind } = target.dataset;
  if (!kind) return;
  try {
    if (kind === "difference") {
      const { difference } = await ask(kind, { values: state.values });
      put("difference", {}, difference);
      return $("change").showModal();
    }
    const isText = kind === "toml" || kind === "csv";
    const content = isText ? new Blob([(await ask(kind, { values: state.values })).text]) : await pictured(kind);
    const link = document.createElement("a");
    link.download = `explored.${kind}`;
    link.href = URL.createObjectURL(content);
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
    $("save").open = false;
  } catch (fault) {
    complain(fault);
  }
});
on("write", "click", async () => {
  try {
    await ask("write", { values: state.values, text: state.start.stamp });
    await follow();
  } catch (fault) {
    complain(fault);
  }
});
on("copy", "click", async ({ target }) => {
  const { what } = target.dataset;
  if (!what) return;
  const words = new URLSearchParams(change.words(state)).toString();
  const path = state.start.path || "SCENARIO.toml";
  const texts = {
    link: shareable(words),
    command: `sim explore ${path}${words ? ` --state '#${words}'` : ""}`,
    methods: state.run?.answer.methods,
  };
  try {
    const text = texts[/** @type {"link"} */ (what)];
    if (!text) throw new Error("Run the scenario's own models first, at one point of the sweep");
    await navigator.clipboard.writeText(text);
    put("copied", {}, "copied");
    $("copy").open = false;
  } catch (fault) {
    complain(fault);
  }
});
for (const id of ["save", "copy"]) {
  on(id, "keydown", (event) => {
    if (event.key !== "Escape") return;
    $(id).open = false;
    $(id).querySelector("summary").focus();
  });
}

// Start

async function begin() {
  if (!authorised(hash())) throw new Error("This page has lost its key. Open the address that sim explore printed.");
  const start = await ask("start", {});
  const kept = stored();
  const first = { ...change.initial(start), ...(kept && { table: kept.table }) };
  // of another text of the file only the table stays
  if (kept?.stamp === start.stamp) Object.assign(first, kept.state);
  $("members").value = Math.max(2, start.members);
  $("main").hidden = false;
  measure();
  const sizes = new ResizeObserver(measure);
  for (const id of ["plot", "words"]) sizes.observe($(id));
  listen();
  const paused = change.withMotion(first, { paused: quiet.matches });
  update(change.linked(paused, hash()));
  if (start.stamp) setInterval(follow, 1000);
}

/** Show the scenario's file as it is saved. */
async function follow() {
  if (document.hidden || asked.has("file")) return;
  const reply = ask("file", {});
  asked.set("file", reply);
  try {
    if ((await reply).stamp !== state.start.stamp) return location.reload();
  } catch (fault) {
    if (!state.trouble) complain(fault);
  }
  asked.delete("file");
}

begin().catch(complain);
