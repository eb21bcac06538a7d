// The page of `sim explore`: gestures change the state, the state asks the server, and the page is drawn from the state.
// All physics is computed by Python.

import { ADDRESSES, QUESTIONS, due } from "./answer.js";
import { ask, authorised, shareable, store, stored, stream } from "./connection.js";
import { written } from "./figure.js";
import { $, STEPS, build, drawn, now, rates, render } from "./render.js";
import * as change from "./state.js";

/** @typedef {import("./state.js").State} State */

const narrow = matchMedia("(max-width: 800px)");
const dark = matchMedia("(prefers-color-scheme: dark)");
const quiet = matchMedia("(prefers-reduced-motion: reduce)");
const screen = () => ({ isDark: dark.matches, isNarrow: narrow.matches });

/** @type {State} */
let state;
let isScheduled = false;
let address = "";
/** Number of the gestures that take back what a text is read for. */
let epoch = 0;
/** @type {Set<string>} */
const asked = new Set();
/** @type {AbortController | null} */
let stopper = null;
/** Ratio of the motion to real time that was reached. */
let reached = 0;
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
  else {
    $("trouble").hidden = false;
    $("trouble").textContent = text;
  }
}

/** Take the next state, draw it within a frame, and ask for what it lacks.
 * @param {State} next */
function update(next) {
  if (next === state) return;
  state = next;
  if (!isScheduled) {
    isScheduled = true;
    requestAnimationFrame(draw);
  }
  due(state).forEach(answer);
  move();
}

function draw() {
  isScheduled = false;
  if (!state.dragging) remember();
  render(state, screen());
  if (state.view.figure === "motion") rates(state, reached);
}

/** Ask for the answer of a name; what is changed meanwhile is asked after it.
 * @param {string} name */
async function answer(name) {
  const question = QUESTIONS[name](state);
  if (asked.has(name) || change.same(failed.get(name), question)) return;
  asked.add(name);
  try {
    const found = await ask(ADDRESSES.get(name) ?? name, question);
    asked.delete(name);
    update(change.answered(state, name, question, found));
    if (name === "curves") draw(); // at once, not in the next frame
  } catch (fault) {
    failed.set(name, question);
    asked.delete(name);
    complain(fault);
  }
}

/** Ask for the next part of the motion. */
async function move() {
  const request = change.nextOfMotion(state);
  if (!request || asked.has("motion") || change.same(failed.get("motion"), request.values)) return;
  asked.add("motion");
  try {
    const found = await ask("motion", request);
    asked.delete("motion");
    if (found.faults) failed.set("motion", request.values);
    else if (state.view.figure === "motion") {
      const isRestart = !request.run;
      update(change.continued(state, request, found));
      if (isRestart && !state.motion.paused) play();
    }
  } catch (fault) {
    failed.set("motion", request.values);
    asked.delete("motion");
    complain(fault);
  }
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
  reached = time - from > 300 ? (state.motion.time - first) / ((time - from) / 1000) : 0;
  if (!isScheduled) {
    now(state, screen());
    rates(state, reached);
  }
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
  const shown = change.textOf(state, sliderOf(key)).split(" ").slice(1).join(" ");
  const isBare = /^[-+]?(\d+[.,]?\d*|[.,]\d+)(e[-+]?\d+)?$/i.test(text.trim());
  const unit = shown.replaceAll("µ", "u").replaceAll("²", "^2").replaceAll("³", "^3");
  const words = isBare ? `${text.trim().replace(",", ".")} ${unit}`.trim() : text;
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

/** @param {string} id
 * @param {string} kind
 * @param {(event: any) => void} act */
const on = (id, kind, act) => $(id).addEventListener(kind, act);

/** Listen to the sliders, of which there may be many, in one place. */
function listen() {
  const keyOf = (/** @type {any} */ item) => (item.matches("#groups input[type=range]") ? item.id : "");
  on("groups", "pointerdown", ({ target }) => keyOf(target) && update(change.released(state)));
  on("groups", "focusout", ({ target }) => keyOf(target) && state.gesture && update(change.released(state)));
  on("groups", "input", ({ target }) => {
    const key = keyOf(target);
    if (key) update(change.moved(state, { [key]: change.valueAt(sliderOf(key), Number(target.value), STEPS) }, key));
  });
  on("groups", "change", ({ target }) => {
    if (keyOf(target)) update(change.rested(state));
    else if (target.id === "meaning") update({ ...state, wavelength: target.value !== "" });
    else if (target.id.startsWith("text ")) read(target.id.slice(5), target.value);
  });
  on("level", "pointerdown", () => update(change.released(state)));
  on("level", "input", () => update(change.viewed(state, { share: Number($("level").value) / 100 }, "level")));
  on("level", "change", () => update(change.rested(state)));
  on("level", "focusout", () => update(change.released(state)));
  for (const name of /** @type {const} */ (["absolute", "first", "loads"])) {
    on(name, "change", () => update(change.viewed(state, { [name]: $(name).checked })));
  }
  on("figures", "change", ({ target }) => update(change.viewed(state, { figure: target.value })));
  on("mechanisms", "change", ({ target }) => {
    const { key, on: full } = /** @type {any} */ (state.start.mechanisms.find((one) => one.key === target.value));
    update(change.moved(state, { [key]: target.checked ? full : 0 }));
  });
  on("point", "change", () => {
    const point = state.start.points[Number($("point").value)];
    update($("point").value === "" || !point ? { ...state } : change.moved(state, point));
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
  const isTyping = field?.type === "text" && field.value !== field.dataset.shown;
  if (!(event.ctrlKey || event.metaKey) || isTyping) return;
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
on("at", "input", () => update({ ...state, reading: Number($("at").value) }));
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
on("rate", "change", () => update(change.withMotion(state, { rate: Number($("rate").value) })));
on("view", "submit", (event) => event.preventDefault());
dark.addEventListener("change", () => state && draw());
narrow.addEventListener("change", () => state && draw());
addEventListener("resize", () => state && draw());

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
  $("unfit").textContent = free.length ? "" : "tick the numbers to fit";
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
    delete $("judged").dataset.fault;
    update(change.tabled(state, data));
  } catch (fault) {
    $("judged").hidden = false;
    $("judged").dataset.fault = "1";
    $("judged").textContent = /** @type {Error} */ (fault).message;
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
      $("change").querySelector("pre").textContent = difference;
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
on("cancel", "click", () => $("change").close());
on("write", "click", async () => {
  $("change").close();
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
    $("copied").textContent = "copied";
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
  build(first);
  listen();
  const paused = change.withMotion(first, { paused: quiet.matches });
  update(change.linked(paused, hash()));
  rates(state, 0);
  if (start.stamp) setInterval(follow, 1000);
}

/** Show the scenario's file as it is saved. */
async function follow() {
  if (document.hidden || asked.has("file")) return;
  asked.add("file");
  try {
    if ((await ask("file", {})).stamp !== state.start.stamp) return location.reload();
  } catch (fault) {
    if (!state.trouble) complain(fault);
  }
  asked.delete("file");
}

begin().catch(complain);
